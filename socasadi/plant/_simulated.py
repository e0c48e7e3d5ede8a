from functools import cached_property
from math import inf, isfinite
from typing import Any, SupportsFloat

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from ..codegen import Buffered, compiled
from ..rod import Chamber, Rod
from ._output import Output, TipDisplacement
from ._protocol import PlantFailure

_FARTHEST = 1.5  # lengths between tip and base beyond which a trial has failed
_NO_FORCE = np.zeros(3)


class SimulatedPlant:
    """A rod, sampled, seen by a noisy sensor.

    Parameters
    ----------
    rod
        The robot.
    sample_time
        s; tensions are held so long.
    noise
        Standard deviation of the sensor's white Gaussian noise, in the output's unit (m; pixels for a camera).
    output
        What is measured: :class:`TipDisplacement`, :class:`LaserSpot` or :class:`Camera`.
    substep
        Longest substep of the rod's integration, s; None as in :meth:`Rod.step`.

    Raises
    ------
    ValueError
        A value is out of range.
    """

    def __init__(
        self,
        rod: Rod,
        sample_time: float = 0.05,
        noise: float = 1e-3,
        output: Output = TipDisplacement(),  # noqa: B008 (frozen)
        substep: float | None = None,
    ) -> None:
        for name, value in (("sample_time", sample_time), ("noise", noise)):
            if not (isinstance(value, SupportsFloat) and isfinite(value) and value >= 0):
                raise ValueError(f"SimulatedPlant: {name} is {value!r}, but must be finite and not negative")
        if sample_time == 0:
            raise ValueError("SimulatedPlant: sample_time is 0 s, but must be above zero")
        if substep is not None and not (isinstance(substep, SupportsFloat) and isfinite(substep) and substep > 0):
            raise ValueError(f"SimulatedPlant: substep is {substep!r} s, but must be above zero, or None")
        output.check(rod.valued)
        self.rod = rod
        self.sample_time = float(sample_time)
        self.noise = float(noise)
        self.output = output
        self.substep = substep
        self._random = np.random.default_rng()
        self._state: np.ndarray | None = None
        self._tension = np.zeros(self.inputs)
        self._tip = np.full(3, np.nan)
        self._seen = np.full(self.outputs, np.nan)
        self._samples = 0

    @property
    def inputs(self) -> int:
        """Number of tensions (pressures, lengths: what the rod's cables and chambers take)."""
        return len(self.rod.cables)

    @property
    def outputs(self) -> int:
        """Number of measured values."""
        return self.output.size

    @property
    def output_unit(self) -> str:
        """Unit of the measured values."""
        return getattr(self.output, "unit", "m")

    @property
    def input_unit(self) -> str:
        """Unit of the inputs: N of tensions, m of lengths, Pa of pressures; none where they differ."""
        units = {"Pa" if isinstance(c, Chamber) else "m" if c.drive == "length" else "N" for c in self.rod.cables}
        return units.pop() if len(units) == 1 else ""

    @property
    def tension(self) -> np.ndarray:
        """The inputs held now (inputs,), N unless the rod's cables and chambers take something else."""
        return self._tension.copy()

    @property
    def tip(self) -> np.ndarray:
        """True position (3,) of the tip, m, base frame."""
        self._running()
        return self._tip.copy()

    @property
    def true_output(self) -> np.ndarray:
        """What a sensor without noise would have measured (outputs,)."""
        self._running()
        return self._seen.copy()

    @property
    def state(self) -> np.ndarray:
        """The rod's state x = [q; v] (2 dof,)."""
        return self._running().copy()

    @property
    def time(self) -> float:
        """Time since the reset, s."""
        return self._samples * self.sample_time

    def shape(self, n: int = 50) -> np.ndarray:
        """Positions (n, 3), m, of ``n`` points evenly spaced along the rod now, base frame."""
        return self.rod.in_base_frame(self.rod.centreline(self._running()[: self.rod.dof], n))

    @cached_property
    def sensor(self) -> ca.Function:
        """CasADi Function of the rod's state x (2 dof,) -> outputs (outputs,) without noise."""
        x = ca.MX.sym("x", 2 * self.rod.dof)
        return ca.Function("sensor", [x], [self._observe(x)[1]])

    def prepare(self) -> None:
        """Build and compile what a step needs, which the first step would do otherwise.

        Raises
        ------
        CompilationError
            The C compiler rejected the code.
        """
        _ = self._advance

    def reset(
        self, tip: ArrayLike | None = None, *, seed: int | None = None, tension_bounds: tuple[Any, Any] = (-inf, inf)
    ) -> np.ndarray:
        """Bring the rod to rest in a static pose.

        Parameters
        ----------
        tip
            (y, z), m, where the tip is held by the tensions of least norm. None takes the pose of slack cables,
            straight or hanging; where the bounds exclude zero, of the tensions closest to it.
        seed
            Of the noise: the same seed gives the same sequence. None draws one.
        tension_bounds
            (lower, upper), N, each a number or one per cable.

        Returns
        -------
        (outputs,)
            Measurement in that pose.

        Raises
        ------
        EquilibriumError
            The tip is out of reach.
        ValueError
            A shape is wrong, a value is not finite, or the bounds cross.
        """
        pose = (
            self.rod.resting(tension_bounds)
            if tip is None
            else self.rod.equilibrium_at(np.asarray(tip, dtype=float), tension_bounds)
        )
        self._random = np.random.default_rng(seed)
        self._samples = 0
        self._tension = pose.input.copy()
        return self._settle(pose.state, *(value.full()[:, 0] for value in self._observe(pose.state)))

    def step(self, tension: ArrayLike, tip_force: ArrayLike | None = None) -> np.ndarray:
        """Hold ``tension`` for one sample.

        Parameters
        ----------
        tension
            (inputs,), N.
        tip_force
            Dead force (3,) at the tip, N, base frame, held as long: a disturbance.

        Returns
        -------
        (outputs,)
            Measurement at the end of the sample.

        Raises
        ------
        PlantFailure
            The state is not finite, the tip is farther than 1.5 rod lengths from the base, or the sensor sees
            nothing. The plant must be reset then.
        RuntimeError
            There was no reset before.
        ValueError
            An argument has the wrong shape or is not finite; the plant has not moved.
        """
        state = self._running()
        applied = _finite("tension", tension, self.inputs, "N")
        force = _NO_FORCE if tip_force is None else _finite("tip_force", tip_force, 3, "N")
        advanced = self._advance(state, applied, np.array(self.rod.base_rotation) @ force)
        self._tension = applied
        self._samples += 1
        return self._settle(*advanced)

    def _settle(self, state: np.ndarray, tip: np.ndarray, seen: np.ndarray) -> np.ndarray:
        self._state = None
        if not (np.isfinite(state).all() and np.isfinite(tip).all()):
            raise PlantFailure(
                f"the state is not finite at {self.time:g} s: the integration of the rod diverged; "
                "a shorter substep may follow so fast a motion"
            )
        distance, length = float(np.linalg.norm(tip)), self.rod.length
        if not distance <= _FARTHEST * length:
            raise PlantFailure(
                f"the tip is {distance:.3g} m from the base at {self.time:g} s, more than {_FARTHEST} times "
                f"the rod's length of {length:g} m"
            )
        if not np.isfinite(seen).all():
            raise PlantFailure(f"the sensor {type(self.output).__name__} sees nothing at {self.time:g} s")
        self._state, self._tip, self._seen = state, tip, seen
        return seen + self.noise * self._random.standard_normal(self.outputs)

    def _running(self) -> np.ndarray:
        if self._state is None:
            raise RuntimeError("the plant has no state: call reset() first, at the start and after every failure")
        return self._state

    @cached_property
    def _observe(self) -> ca.Function:
        """x -> (tip position, output)"""
        x = ca.MX.sym("x", 2 * self.rod.dof)
        pose = ca.DM(np.linalg.inv(self.rod.base_pose)) @ self.rod.pose(x[: self.rod.dof], self.rod.length)
        return ca.Function("observe", [x], [pose[:3, 3], self.output.measure(pose)])

    @cached_property
    def _advance(self) -> Buffered:
        """(x, tension, tip_force) -> (x, tip position, output) one sample later"""
        step = self.rod.step_expression(self.sample_time, self.substep)
        arguments = step.mx_in()
        x_next = step(*arguments)
        return Buffered(compiled(ca.Function("plant_step", arguments, [x_next, *self._observe(x_next)])))

    def __getstate__(self) -> dict[str, Any]:
        rebuilt = ("sensor", "_observe", "_advance")
        return {name: value for name, value in self.__dict__.items() if name not in rebuilt}


def _finite(name: str, value: ArrayLike, size: int, unit: str) -> np.ndarray:
    try:
        array = np.array(value, dtype=float)
    except (TypeError, ValueError):
        raise ValueError(f"{name} is {value!r}, but must be {size} numbers in {unit}") from None
    if array.shape != (size,):
        raise ValueError(f"{name} has shape {array.shape}, but must have shape ({size},), in {unit}")
    if not np.isfinite(array).all():
        raise ValueError(f"{name} is {array.tolist()} {unit}, but must be finite")
    return array
