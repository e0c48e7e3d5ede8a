import math
from collections.abc import Sequence
from dataclasses import dataclass
from numbers import Real

import casadi as ca

from ._base import PredictionModel
from ._entry import Entry

_SLENDER = (1.0, 1000.0)
"""Between which an arm's length over its cables' offset lies; beyond, one of the two is in another unit."""


@dataclass(frozen=True)
class Modal(PredictionModel):
    r"""One oscillator an axis: a frequency, a damping ratio and a static gain for each input.

    Axis i obeys :math:`\ddot y_i + 2 \zeta_i \omega_i \dot y_i + \omega_i^2 y_i = \omega_i^2 \sum_j g_{ij} u_j`,
    sampled exactly with the input held (zero-order hold). theta lists, axis after axis, :math:`\omega` (rad/s),
    :math:`\zeta` and the gains :math:`g` (m/N): ``axes * (2 + inputs)`` numbers, 10 for two axes and three cables.
    States are position and velocity of each axis; there is no feedthrough.

    The default bounds hold for a rod like the paper's of which nothing else is known, not even where its cables run;
    :meth:`from_spec` and :func:`bounds_from_record` give tighter ones.
    """

    @property
    def order(self) -> int:
        return 2 * self.axes

    @classmethod
    def from_spec(
        cls,
        *,
        length: float,
        bending_stiffness: float,
        mass_per_length: float,
        cable_offset: float,
        cable_angles: Sequence[float] = (0.0, 120.0, 240.0),
        margin: float = 2.0,
        damping_ratio: tuple[float, float] = (0.02, 0.5),
    ) -> "Modal":
        r"""Bounds of a planar tip from a data sheet, by the formulas of the clamped Euler-Bernoulli beam.

        The first frequency is :math:`1.8751^2 \sqrt{EI / (\mu L^4)}`; a cable at distance d from the axis bends the rod
        into an arc, towards its own angle, and moves the tip by :math:`g = d L^2 / (2 EI)` a newton. The bounds
        allow for a frequency that is off by a factor of ``margin`` either way, and for gains that are off by
        :math:`(1 - 1/margin) g`: with the default, cables half or one and a half times as strong as the data sheet
        has them, or about 30 degrees off their angle.

        Parameters
        ----------
        length
            L, m.
        bending_stiffness
            EI, N m2.
        mass_per_length
            Mass per length, kg/m.
        cable_offset
            d, m.
        cable_angles
            Where each cable runs in the section, degrees from +y towards +z.
        margin
            How far the data sheet may be off, a factor above 1.
        damping_ratio
            Bounds of the damping ratio, which no data sheet gives.
        """
        spec = {
            "length": length,
            "bending_stiffness": bending_stiffness,
            "mass_per_length": mass_per_length,
            "cable_offset": cable_offset,
        }
        for name, value in spec.items():
            if not (isinstance(value, Real) and math.isfinite(value) and value > 0):
                raise ValueError(f"{name} must be positive, not {value!r}")
        slender = length / cable_offset
        if not _SLENDER[0] <= slender <= _SLENDER[1]:
            raise ValueError(
                f"length is {length:g} m and cable_offset {cable_offset:g} m, a ratio of {slender:,.3g}, and no soft "
                "arm is so made: are both in m?"
            )
        if not (isinstance(damping_ratio, Sequence) and len(damping_ratio) == 2):
            raise ValueError(f"damping_ratio is a pair of bounds, not {damping_ratio!r}")
        if not (math.isfinite(margin) and margin > 1):
            raise ValueError(f"margin is a factor above 1, not {margin}")
        frequency = 1.875104**2 * math.sqrt(bending_stiffness / (mass_per_length * length**4))
        gain = cable_offset * length**2 / (2 * bending_stiffness)
        bounds: list[tuple[float, float]] = []
        for direction in (math.cos, math.sin):
            centres = [gain * direction(math.radians(angle)) for angle in cable_angles]
            width = gain * (1 - 1 / margin)
            bounds += [(frequency / margin, frequency * margin), damping_ratio]
            # Rounded, so that a bound that is zero is not 1e-18, and plus zero, so that it is not -0.
            bounds += [(round(centre - width, 12) + 0.0, round(centre + width, 12) + 0.0) for centre in centres]
        return cls(axes=2, inputs=len(centres), bounds=tuple(bounds))

    def _default_entries(self) -> tuple[Entry, ...]:
        entries: list[Entry] = []
        for axis in axis_names(self.axes):
            entries.append(Entry(f"frequency_{axis}", "rad/s", 2.0, 10.0, "log"))
            entries.append(Entry(f"damping_ratio_{axis}", "1", 0.02, 0.5, "log"))
            entries += [Entry(f"gain_{axis}{j + 1}", "m/N", -0.012, 0.012) for j in range(self.inputs)]
        return tuple(entries)

    def _matrices(self, theta: ca.SX, sample_time: float) -> tuple[ca.SX, ...]:
        per_axis = ca.reshape(theta, 2 + self.inputs, self.axes)
        A, B, C = [], [], []
        for i in range(self.axes):
            frequency, ratio, gains = per_axis[0, i], per_axis[1, i], per_axis[2:, i].T
            block = _oscillator(frequency, ratio, sample_time)
            A.append(block)
            # A constant input makes gain * u the rest position, so that B = (I - A) times the rest state per input.
            B.append((ca.SX.eye(2) - block)[:, 0] @ gains)
            C.append(ca.SX([[1, 0]]))
        return ca.diagcat(*A), ca.vertcat(*B), ca.diagcat(*C), ca.SX(self.axes, self.inputs)


def axis_names(count: int) -> list[str]:
    """Names of the measured axes: y and z for the plane, numbers beyond."""
    return ["y", "z"][:count] if count <= 2 else [str(i + 1) for i in range(count)]


def _oscillator(frequency: ca.SX, ratio: ca.SX, time: float) -> ca.SX:
    """exp(A t) of a damped oscillator in position and velocity, for any damping ratio above 0."""
    decay = ratio * frequency
    # (1 - ratio^2) is kept away from zero: at critical damping the two forms meet and the error is below 1e-9.
    gap = 1 - ratio**2
    gap = ca.if_else(ca.fabs(gap) < 1e-10, 1e-10, gap)
    swing = frequency * ca.sqrt(ca.fabs(gap))
    under = ratio < 1
    cosine = ca.if_else(under, ca.cos(swing * time), ca.cosh(swing * time))
    sine = ca.if_else(under, ca.sin(swing * time), ca.sinh(swing * time)) / swing
    rows = ca.vertcat(
        ca.horzcat(cosine + decay * sine, sine),
        ca.horzcat(-(frequency**2) * sine, cosine - decay * sine),
    )
    return ca.exp(-decay * time) * rows
