from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..campaign import Cost, Study, Units
from ..model import Record, StateSpace
from ..rod import Cable, EquilibriumError
from ._known import RodRobot
from ._optimum import Optimum, optimum
from ._reach import Bounds, nearest, reachable
from ._robot import Pose, Robot

CLOSE, FAR = 0.01, 0.05
"""Shares of what is asked for by which a pose may miss it: it is met up to the first, and not from the second on."""

_PLACES = 24
"""Points of the reference that are looked at."""


def percent(share: float) -> str:
    """A share as it is told: two digits, and no more than hundredths of a percent."""
    return f"{round(float(f'{100 * share:.2g}'), 2) + 0.0:g} %"


def _number(value: float) -> str:
    """Three digits, and no exponent where there need not be one."""
    return f"{float(f'{value:.3g}') + 0.0:,.10g}"


@dataclass(frozen=True, eq=False)
class Case:
    """A study, what is known of its robot, and what follows from the two; each is found when first asked for.

    Attributes
    ----------
    noise
        Standard deviation of the sensor's noise, in the outputs' unit; None where nobody knows.
    record
        A probing record of the robot, if there is one.
    """

    study: Study
    robot: Robot
    noise: float | None
    record: Record | None = None

    @property
    def bounds(self) -> Bounds:
        return self.study.mpc.input_limits

    @cached_property
    def pulling(self) -> Bounds | None:
        """The bounds if the inputs could only pull; None where they are no tensions, or only pull or push as it is."""
        lower, upper = self.bounds
        cables = self.of_a_rod.rod.cables if self.of_a_rod else ()
        if self.units.input != "N" or not all(isinstance(cable, Cable) for cable in cables):
            return None
        return (np.maximum(lower, 0.0), upper) if (lower < 0).any() and (upper > 0).all() else None

    def corners(self, bounds: Bounds) -> np.ndarray:
        """Corners (k, 2) of the convex hull of where it can be held within these inputs."""
        key = tuple(np.concatenate(bounds).tolist())
        if key not in self._hulls:
            self._hulls[key] = reachable(self.robot, bounds, self.robot.pose(np.clip(self.robot.neutral, *bounds)))
        return self._hulls[key]

    @cached_property
    def _hulls(self) -> dict[tuple[float, ...], np.ndarray]:
        return {}

    @cached_property
    def units(self) -> Units:
        return Units.of(self.study.plant)

    def length(self, value: float) -> str:
        """A value of the outputs, as it is told."""
        return self.span(value, value)

    def span(self, low: float, high: float) -> str:
        """From one value to another, as it is told."""
        factor, unit = self.units.shown
        ends = dict.fromkeys(_number(factor * value) for value in (low, high))
        return f"{' to '.join(ends)} {unit}"

    def lengths(self, values: np.ndarray) -> str:
        """Outputs (p,) as they are told."""
        factor, unit = self.units.shown
        return f"({', '.join(_number(factor * value) for value in values)}) {unit}"

    def share(self, given: np.ndarray) -> float:
        """The largest share of the way from doing nothing to a bound that inputs (m,) go."""
        nothing = np.clip(self.robot.neutral, *self.bounds)
        way = np.where(given > nothing, self.bounds[1] - nothing, nothing - self.bounds[0])
        gone = np.abs(given - nothing)
        return float(np.max(np.divide(gone, way, out=np.zeros_like(gone), where=way > 0)))

    @cached_property
    def rest(self) -> Pose:
        """At rest, with as little input as the bounds allow."""
        return self.robot.pose(np.clip(self.robot.neutral, *self.bounds))

    @cached_property
    def start(self) -> Pose:
        """Where the task begins; EquilibriumError where the robot cannot be held there."""
        if self.study.task.start is None:
            return self.rest
        return self.robot.released(np.asarray(self.study.task.start), self.bounds)

    @cached_property
    def begun(self) -> Pose:
        """Where the task begins, or rest where that cannot be."""
        try:
            return self.start
        except EquilibriumError:
            return self.rest

    @cached_property
    def reference(self) -> np.ndarray:
        """(T + 1, p)"""
        time = self.study.mpc.sample_time
        return self.study.task.reference(time * np.arange(self.study.task.samples(time) + 1))

    @cached_property
    def places(self) -> np.ndarray:
        """Different points of the reference (k, p), evenly spread in time, and those farthest from rest."""
        wanted = self.reference[1:]
        rows = np.linspace(0, len(wanted) - 1, min(_PLACES, len(wanted))).round().astype(int)
        distance = np.linalg.norm(wanted - self.rest.output, axis=1)
        return np.unique(np.vstack([wanted[rows], wanted[[distance.argmax()]]]).round(12), axis=0)

    @cached_property
    def held(self) -> list[Pose]:
        """The pose nearest to each of the places."""
        poses, pose = [], self.rest
        for wanted in self.places:
            pose = nearest(self.robot, wanted, self.bounds, pose)
            if self._miss(pose, wanted) > CLOSE * self.asked:
                # Winches may leave cables slack, which hides what they do; all of them tightened do not.
                calm = (np.clip(self.robot.neutral, *self.bounds) + self.bounds[0]) / 2
                tight = nearest(self.robot, wanted, self.bounds, self.robot.pose(calm), calm)
                pose = min(pose, tight, key=lambda pose: self._miss(pose, wanted))
            poses.append(pose)
        return poses

    @staticmethod
    def _miss(pose: Pose, wanted: np.ndarray) -> float:
        return float(np.linalg.norm(pose.output - wanted))

    @cached_property
    def misses(self) -> np.ndarray:
        """How far each of these is from what is wanted (k,)."""
        return np.array([self._miss(pose, wanted) for pose, wanted in zip(self.held, self.places, strict=True)])

    @cached_property
    def effort(self) -> float:
        """The largest share of the inputs' way to their bounds that holding the reference takes."""
        return max(self.share(pose.input) for pose in self.held)

    @property
    def holds(self) -> bool:
        """Whether the reference can be held, or nearly so."""
        return bool(self.misses.max() <= FAR * self.size)

    @property
    def moved(self) -> float:
        """How far the outputs can be moved from rest towards the reference."""
        return float(np.linalg.norm(self.far.output - self.rest.output))

    @property
    def size(self) -> float:
        """What misses are compared with: how far the outputs have to move, or can."""
        return max(self.asked, self.moved)

    @cached_property
    def asked(self) -> float:
        """How far the task wants the outputs to move: the largest distance of the reference from where they are."""
        return float(np.linalg.norm(self.reference[1:] - self.begun.output, axis=1).max())

    @cached_property
    def linear(self) -> StateSpace:
        """The robot about rest."""
        return self.robot.linear(self.rest)

    def best_flight(self, cost: Cost) -> Optimum:
        """The flight of least J on the robot's linear model about rest."""
        key = (cost.input_term, np.asarray(cost.Q, dtype=float).tobytes(), np.asarray(cost.R, dtype=float).tobytes())
        if key not in self._flights:
            rest, scale = self.rest, self.study.mpc.input_scale
            wanted, start = self.reference[1:] - rest.output, self.begun.input - rest.input
            self._flights[key] = optimum(self.linear, wanted, cost, scale, start, rest.input)
        return self._flights[key]

    @cached_property
    def _flights(self) -> dict[tuple[str, bytes, bytes], Optimum]:
        return {}

    def followed(self, flight: Optimum) -> float:
        """What share of the way that the task asks for a flight goes: 1 is all, 0 is not to move."""
        way = self.reference[1:] - self.begun.output
        moved = flight.output + self.rest.output - self.begun.output
        return float(np.sum(moved * way) / np.sum(way**2)) if way.any() else 1.0

    @cached_property
    def settled(self) -> np.ndarray:
        """Which samples come after 5 s, as in the RMSE; of a task shorter than 10 s the second half."""
        ends = self.study.mpc.sample_time * np.arange(1, len(self.reference))
        return ends > min(5.0, ends[-1] / 2 - 1e-9)

    @property
    def far(self) -> Pose:
        """The held pose whose outputs lie farthest from rest."""
        return max(self.held, key=lambda pose: float(np.linalg.norm(pose.output - self.rest.output)))

    @property
    def of_a_rod(self) -> RodRobot | None:
        """The rod, where its poses are known from one."""
        statics = getattr(self.robot, "statics", self.robot)
        return statics if isinstance(statics, RodRobot) else None
