from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ...model import StateSpace
from ..formulation import Design
from ._loop import Loop, closed_loop, decays, prediction_model, regulator_matrix
from ._observability import observability, unstable_part
from ._page import page
from ._peak import Peak, largest_gain
from ._stability import established, not_established

if TYPE_CHECKING:
    from .._spec import LinearMPC

_OFFSET = 1e-8
_GONE = 0.05
"""A pole of this magnitude has died out within a sample; it is left out where damping is looked at."""
_GAIN_STEP, _GAIN_RANGE = 1.05, 1e3


@dataclass(frozen=True, eq=False)
class Poles:
    """Poles of a sampled system, the largest first."""

    values: np.ndarray
    sample_time: float

    @property
    def radius(self) -> float:
        """Spectral radius: the system is stable below 1."""
        return float(np.abs(self.values[0]))

    @property
    def time_constant(self) -> float:
        """The slowest, s; infinite where a pole does not decay."""
        return _time_constant(self.radius, self.sample_time)

    @property
    def least_damped(self) -> tuple[float, float]:
        """Damping ratio and natural frequency (Hz) of the least damped poles; (1, nan) where none oscillates."""
        lasting = self.values[np.abs(self.values) > _GONE]
        # A real pole below 0 rings from sample to sample, and counts as oscillating.
        continuous = np.log(lasting.astype(complex)) / self.sample_time
        continuous = continuous[continuous.imag != 0]
        if not len(continuous):
            return 1.0, np.nan
        ratios = -continuous.real / np.abs(continuous)
        least = ratios.argmin()
        return float(ratios[least]), float(np.abs(continuous[least]) / (2 * np.pi))


@dataclass(frozen=True, eq=False)
class Analysis:
    """What linear theory says of a controller while no bound is active, and what it does not say.

    The loop is the controller's step, sample for sample, around a linear plant; printed, it is a page. See
    :func:`analyse`.
    """

    sample_time: float
    """s"""
    on_model: bool
    """The plant is the prediction model itself."""
    regulator: Poles
    """Of the law on the prediction model with its state known. With ``observer`` they are the loop's poles there."""
    observer: Poles
    """Of the estimate's error on the prediction model."""
    loop: Poles
    """Of the loop around the plant."""
    output_time_constant: float
    """s, of the slowest mode of the loop that the outputs show; slower ones move inputs whose effects cancel."""
    observability: float
    """Of the prediction model and its disturbances together, from 0 (not at all) to 1, see :func:`observability`."""
    observability_model: float
    """Of the prediction model alone."""
    stabilisability: float
    """The like of the prediction model's unstable modes from the inputs: 0 not at all; 1 too where there is none."""
    unstable_modes: int
    """Of the prediction model by itself."""
    reference_gain: np.ndarray
    """(p, p) output at rest for a constant reference; nan, as all of these, where the loop does not come to rest."""
    output_disturbance_gain: np.ndarray
    """(p, p) output at rest for a constant disturbance of the outputs."""
    input_disturbance_gain: np.ndarray
    """(p, m) m/N, output at rest for a constant unknown tension beside the inputs."""
    measured_disturbance_gain: np.ndarray
    """(p, k) output at rest for a constant measured disturbance."""
    offset: float
    """The largest entry by which these gains miss 1 (reference) and 0, with the input's in m per u_max."""
    sensitivity: Peak
    """Output disturbance to output, -."""
    complementary: Peak
    """Measurement noise to output, -."""
    noise_to_input: Peak
    """Measurement noise to input in shares of u_max, 1/m."""
    gain_margin: tuple[float, float]
    """Factors on the plant's gain between which the loop is stable: 0 and infinity stand for none found down to a
    thousandth and up to a thousand; nan where the loop is not stable as it is."""
    established: tuple[str, ...]
    """What is established of stability."""
    not_established: tuple[str, ...]
    """What is not."""

    @property
    def poles(self) -> np.ndarray:
        """All poles of the loop around the plant."""
        return self.loop.values

    @property
    def spectral_radius(self) -> float:
        return self.loop.radius

    @property
    def stable(self) -> bool:
        """The loop around the plant, while no bound is active."""
        return decays(self.spectral_radius)

    @property
    def integral_action(self) -> bool:
        """Nothing is left at rest of a constant disturbance of the outputs (to 1e-8)."""
        return bool((np.abs(self.output_disturbance_gain) < _OFFSET).all())

    @property
    def offset_free(self) -> bool:
        """At rest the output is the reference, whatever constant disturbance there is (to 1e-8)."""
        return self.offset < _OFFSET

    @property
    def robust_error(self) -> float:
        """1/|T|: any stable error of the plant, as a share of its output, of less gain leaves the loop stable."""
        return _inverse(self.complementary.gain)

    def __str__(self) -> str:
        return page(self)


def analyse(mpc: "LinearMPC", design: Design, system: StateSpace | None = None) -> Analysis:
    """The loop of a design while no bound is active, around a linear plant.

    Parameters
    ----------
    system
        The plant, of any order, with the inputs (N) and outputs (m) of the prediction model and at its sample time;
        its inputs, too, act ``mpc.delay`` samples late (more delay goes into its states). None: the prediction model.

    Raises
    ------
    ValueError
        The plant's matrices do not fit, or are not finite.
    """
    model = prediction_model(mpc, design)
    plant = model if system is None else _checked(system, mpc)
    loop = closed_loop(mpc, design, plant)
    regulator = _poles(regulator_matrix(mpc, design, model), mpc)
    observer = _poles(design.A - design.gain @ design.C @ design.A, mpc)
    whole = _poles(loop.A, mpc)
    if system is None:
        # They separate, and are more exact apart.
        whole = Poles(_sorted(np.concatenate([regulator.values, observer.values])), mpc.sample_time)

    stable = decays(whole.radius)
    n, p = len(model.A), mpc.outputs
    beside_queue = np.r_[:n, design.order - p : design.order]
    unstable = unstable_part(model.A, model.B[:, : mpc.inputs] * mpc.input_scale)
    y, v = slice(p), slice(p, None)
    complementary = _peak(loop, "n", y, stable, mpc)
    rest = {by: _gain_at_rest(loop, by, stable) for by in "rdiw"}
    missed = [rest["r"] - np.eye(p), rest["d"], rest["i"], rest["w"]]
    radii = {"loop_radius": whole.radius, "open_radius": float(np.abs(np.linalg.eigvals(plant.A)).max())}
    nominal = max(regulator.radius, observer.radius)
    return Analysis(
        sample_time=mpc.sample_time,
        on_model=system is None,
        regulator=regulator,
        observer=observer,
        loop=whole,
        output_time_constant=_seen_in_outputs(loop, design, mpc.sample_time),
        observability=observability(
            design.A[np.ix_(beside_queue, beside_queue)], design.C[:, beside_queue], mpc.horizon
        ),
        observability_model=observability(model.A, model.C, mpc.horizon),
        stabilisability=observability(*unstable, mpc.horizon) if len(unstable[0]) else 1.0,
        unstable_modes=len(unstable[0]),
        reference_gain=rest["r"],
        output_disturbance_gain=rest["d"],
        input_disturbance_gain=rest["i"] / mpc.input_scale,
        measured_disturbance_gain=rest["w"],
        offset=max(float(np.abs(part).max()) for part in missed if part.size),
        sensitivity=_peak(loop, "d", y, stable, mpc),
        complementary=complementary,
        noise_to_input=_peak(loop, "n", v, stable, mpc),
        gain_margin=_gain_margin(mpc, design, plant, loop) if stable else (np.nan, np.nan),
        established=established(mpc, nominal_radius=nominal, on_model=system is None, **radii),
        not_established=not_established(mpc, robust_error=_inverse(complementary.gain), **radii),
    )


def _checked(system: StateSpace, mpc: "LinearMPC") -> StateSpace:
    plant = StateSpace(*(np.asarray(matrix, dtype=float) for matrix in system))
    n, m, p = len(np.atleast_1d(plant.A)), mpc.model.inputs, mpc.outputs
    shapes = {"A": (n, n), "B": (n, m), "C": (p, n), "D": (p, m)}
    for name, shape in shapes.items():
        matrix = getattr(plant, name)
        if matrix.shape != shape:
            raise ValueError(
                f"the plant's {name} has shape {matrix.shape}, but {shape} fits {n} states, {m} inputs, {p} outputs"
            )
        if not np.isfinite(matrix).all():
            raise ValueError(f"the plant's {name} is not finite")
    return plant


def _inverse(gain: float) -> float:
    return 1 / gain if gain else np.inf


def _sorted(values: np.ndarray) -> np.ndarray:
    return values[np.argsort(-np.abs(values), kind="stable")]


def _poles(A: np.ndarray, mpc: "LinearMPC") -> Poles:
    return Poles(_sorted(np.linalg.eigvals(A)), mpc.sample_time)


def _time_constant(radius: float, sample_time: float) -> float:
    if not decays(radius):
        return np.inf
    return -sample_time / np.log(radius) if radius > 0 else 0.0


def _seen_in_outputs(loop: Loop, design: Design, sample_time: float) -> float:
    """s, of the slowest mode that moves the outputs by more than a thousandth of what its inputs could."""
    values, modes = np.linalg.eig(loop.A)
    y, v = np.split(loop.C @ modes, [loop.outputs])
    reach = np.linalg.norm(design.C @ design.rest + design.D, 2)
    floor = 1e-9 * np.linalg.norm(loop.C[: loop.outputs], 2)
    seen = np.linalg.norm(y, axis=0) > np.maximum(1e-3 * reach * np.linalg.norm(v, axis=0), floor)
    return _time_constant(float(np.abs(values[seen]).max(initial=0.0)), sample_time)


def _gain_at_rest(loop: Loop, by: str, stable: bool) -> np.ndarray:
    columns = loop.driven(by)
    B, D = loop.B[:, columns], loop.D[: loop.outputs, columns]
    if not stable:
        return np.full(D.shape, np.nan)
    return loop.C[: loop.outputs] @ np.linalg.solve(np.eye(len(loop.A)) - loop.A, B) + D


def _peak(loop: Loop, by: str, rows: slice, stable: bool, mpc: "LinearMPC") -> Peak:
    if not stable:
        return Peak(np.inf, np.nan)
    columns = loop.driven(by)
    gain, angle = largest_gain(loop.A, loop.B[:, columns], loop.C[rows], loop.D[rows, columns])
    return Peak(gain, angle / (2 * np.pi * mpc.sample_time))


def _gain_margin(mpc: "LinearMPC", design: Design, plant: StateSpace, loop: Loop) -> tuple[float, float]:
    """Factors around 1 on the plant's outputs at which poles reach the unit circle: by steps of 5 %, then halving."""
    opened = closed_loop(mpc, design, plant, 0.0).A
    change = loop.A - opened

    def stable(factor: float) -> bool:
        return decays(np.abs(np.linalg.eigvals(opened + factor * change)).max())

    def limit(step: float, none: float) -> float:
        inside = 1.0
        while stable(inside * step):
            inside *= step
            if not 1 / _GAIN_RANGE < inside < _GAIN_RANGE:
                return none
        outside = inside * step
        while abs(outside / inside - 1) > 1e-9:
            middle = np.sqrt(inside * outside)
            inside, outside = (middle, outside) if stable(middle) else (inside, middle)
        return float(inside)

    return limit(1 / _GAIN_STEP, 0.0), limit(_GAIN_STEP, np.inf)
