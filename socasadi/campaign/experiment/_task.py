import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from numbers import Real

import numpy as np


@dataclass(frozen=True)
class Pulse:
    """A force that disturbs the tip for a while.

    Parameters
    ----------
    time, duration
        Start and length, s.
    force
        (3,) N, dead, in the base frame.
    """

    time: float
    duration: float
    force: tuple[float, float, float]

    def __post_init__(self) -> None:
        if not (_number(self.time) and self.time >= 0 and _number(self.duration) and self.duration > 0):
            raise ValueError(
                f"a pulse starts at 0 s or later and lasts, not from {self.time!r} for {self.duration!r} s"
            )
        _vector("the force of a pulse", self.force, 3)

    def at(self, time: float) -> tuple[float, float, float]:
        """Force during a sample that starts at ``time``, N."""
        # A sample belongs to the pulse when it starts in it; the margin forgives the rounding of t = k * sample_time.
        inside = self.time - 1e-9 <= time < self.time + self.duration - 1e-9
        return self.force if inside else (0.0, 0.0, 0.0)

    def samples(self, sample_time: float, count: int) -> int:
        """During how many of a task's ``count`` samples it pushes."""
        return sum(any(self.at(k * sample_time)) for k in range(count)) if any(self.force) else count

    @property
    def in_words(self) -> str:
        """What somebody has to do who applies it by hand."""
        force = ", ".join(f"{value:g}" for value in self.force)
        return (
            f"at t = {self.time:g} s push the tip for {self.duration:g} s with ({force}) N along x, y, z of the base, "
            "x along the arm at rest; the direction stays as the arm moves"
        )


@dataclass(frozen=True, kw_only=True)
class Task(ABC):
    """What the outputs have to do: a reference over time, from where, and how long.

    A task of one's own is a frozen dataclass that inherits this one and defines :meth:`reference`. Arguments are given
    by name.

    Parameters
    ----------
    duration
        s.
    pulse
        A disturbance of the tip, or None.
    """

    duration: float = 20.0
    pulse: Pulse | None = None

    def __post_init__(self) -> None:
        _positive("duration of a task", self.duration)
        if not (self.pulse is None or isinstance(self.pulse, Pulse)):
            raise TypeError(f"pulse of a task is a Pulse or None, not {self.pulse!r}")

    @property
    def start(self) -> tuple[float, ...] | None:
        """Tip (y, z) from whose static pose the robot is released, m; None for the robot at rest without tensions."""
        return None

    @abstractmethod
    def reference(self, time: np.ndarray) -> np.ndarray:
        """Wanted outputs (k, p), m, at the instants ``time`` (k,), s; also asked for beyond the duration (preview)."""

    def samples(self, sample_time: float) -> int:
        """Number of samples in the task; ValueError when there is not even one, or its pulse pushes in none."""
        count = round(self.duration / sample_time)
        if count < 1:
            raise ValueError(f"the task's {self.duration} s are shorter than one sample of {sample_time} s")
        if self.pulse is not None and not self.pulse.samples(sample_time, count):
            raise ValueError(
                f"the pulse of {self.pulse.duration:g} s at {self.pulse.time:g} s pushes in no sample of the task, "
                f"which are {sample_time:g} s each from 0 to {self.duration:g} s: those are that begin in the pulse"
            )
        return count


@dataclass(frozen=True, kw_only=True)
class Origin(Task):
    """Scenario 1 of the paper: released at rest from a bent pose, the tip goes to the origin and stays.

    Parameters
    ----------
    tip
        (y, z) of the pose from which the robot is released, m.
    """

    tip: tuple[float, float] = (-0.01, 0.04)

    def __post_init__(self) -> None:
        super().__post_init__()
        _vector("tip of the origin task", self.tip, 2)

    @property
    def start(self) -> tuple[float, ...]:
        return self.tip

    def reference(self, time: np.ndarray) -> np.ndarray:
        return np.zeros((len(time), len(self.tip)))


@dataclass(frozen=True, kw_only=True)
class Circle(Task):
    """Scenario 2 of the paper: the tip, at first at the origin, follows a circle about it.

    The reference starts at (radius, 0) and runs from +y towards +z.

    Parameters
    ----------
    radius
        m.
    period
        s for one turn.
    """

    radius: float = 0.05
    period: float = 20.0

    def __post_init__(self) -> None:
        super().__post_init__()
        _positive("radius of a circle", self.radius)
        _positive("period of a circle", self.period)

    def reference(self, time: np.ndarray) -> np.ndarray:
        angle = 2 * np.pi * np.asarray(time) / self.period
        return self.radius * np.column_stack([np.cos(angle), np.sin(angle)])


@dataclass(frozen=True, kw_only=True)
class FigureEight(Task):
    """The tip, at first at the origin, follows an eight that crosses itself there.

    (y, z) = (width sin a, height sin 2a), a = 2 pi t / period (lemniscate of Gerono).

    Parameters
    ----------
    width, height
        How far it goes from the origin along +y and +z, m.
    period
        s for the whole eight.
    """

    width: float = 0.05
    height: float = 0.025
    period: float = 20.0

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("width", "height", "period"):
            _positive(f"{name} of an eight", getattr(self, name))

    def reference(self, time: np.ndarray) -> np.ndarray:
        angle = 2 * np.pi * np.asarray(time) / self.period
        return np.column_stack([self.width * np.sin(angle), self.height * np.sin(2 * angle)])


@dataclass(frozen=True, kw_only=True)
class SetPoints(Task):
    """The outputs go to one point after another, and stay at the last.

    Parameters
    ----------
    points
        Wanted outputs, m, from the beginning on: (p,) each.
    hold
        s at each.
    """

    points: tuple[tuple[float, ...], ...]
    hold: float = 5.0

    def __post_init__(self) -> None:
        super().__post_init__()
        _positive("hold of set-points", self.hold)
        if not (isinstance(self.points, Sequence) and self.points and isinstance(self.points[0], Sequence)):
            raise ValueError(f"points of set-points are one or more tuples of outputs, not {self.points!r}")
        for point in self.points:
            _vector("a set-point", point, len(self.points[0]))
        object.__setattr__(self, "points", tuple(tuple(map(float, point)) for point in self.points))

    def reference(self, time: np.ndarray) -> np.ndarray:
        # A point is wanted from the very instant on; the margin forgives the rounding of t = k * sample_time.
        index = np.floor(np.asarray(time) / self.hold + 1e-9).astype(int)
        return np.array(self.points)[np.clip(index, 0, len(self.points) - 1)]


def _number(value: object) -> bool:
    return isinstance(value, Real) and math.isfinite(value)


def _positive(what: str, value: float) -> None:
    if not (_number(value) and value > 0):
        raise ValueError(f"{what} must be positive, not {value!r}")


def _vector(what: str, values: Sequence[float], size: int) -> None:
    if not (isinstance(values, Sequence | np.ndarray) and len(values) == size and all(map(_number, values))):
        raise ValueError(f"{what} is {size} finite numbers, not {values!r}")
