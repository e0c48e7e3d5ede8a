import math
from abc import ABC, abstractmethod
from dataclasses import dataclass

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
        if not (math.isfinite(self.time) and self.time >= 0 and math.isfinite(self.duration) and self.duration > 0):
            raise ValueError(f"a pulse starts at 0 s or later and lasts, not from {self.time} for {self.duration} s")
        if len(self.force) != 3 or not all(math.isfinite(component) for component in self.force):
            raise ValueError(f"the force of a pulse is three finite numbers, not {self.force}")

    def at(self, time: float) -> tuple[float, float, float]:
        """Force during a sample that starts at ``time``, N."""
        # A sample belongs to the pulse when it starts in it; the margin forgives the rounding of t = k * sample_time.
        inside = self.time - 1e-9 <= time < self.time + self.duration - 1e-9
        return self.force if inside else (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Task(ABC):
    """What the outputs have to do: a reference over time, from where, and how long.

    A task of one's own is a frozen dataclass that inherits this one and defines :meth:`reference`.

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
        if not (math.isfinite(self.duration) and self.duration > 0):
            raise ValueError(f"duration of a task must be positive, not {self.duration} s")

    @property
    def start(self) -> tuple[float, ...] | None:
        """Tip (y, z) from whose static pose the robot is released, m; None for the robot at rest without tensions."""
        return None

    @abstractmethod
    def reference(self, time: np.ndarray) -> np.ndarray:
        """Wanted outputs (k, p), m, at the instants ``time`` (k,), s; also asked for beyond the duration (preview)."""

    def samples(self, sample_time: float) -> int:
        """Number of samples in the task; ValueError when there is not even one."""
        count = round(self.duration / sample_time)
        if count < 1:
            raise ValueError(f"the task's {self.duration} s are shorter than one sample of {sample_time} s")
        return count


@dataclass(frozen=True)
class Origin(Task):
    """Scenario 1 of the paper: released at rest from a bent pose, the tip goes to the origin and stays.

    Parameters
    ----------
    tip
        (y, z) of the pose from which the robot is released, m.
    """

    tip: tuple[float, float] = (-0.01, 0.04)

    @property
    def start(self) -> tuple[float, ...]:
        return self.tip

    def reference(self, time: np.ndarray) -> np.ndarray:
        return np.zeros((len(time), len(self.tip)))


@dataclass(frozen=True)
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
        for name in ("radius", "period"):
            if not (math.isfinite(getattr(self, name)) and getattr(self, name) > 0):
                raise ValueError(f"{name} of a circle must be positive, not {getattr(self, name)}")

    def reference(self, time: np.ndarray) -> np.ndarray:
        angle = 2 * np.pi * np.asarray(time) / self.period
        return self.radius * np.column_stack([np.cos(angle), np.sin(angle)])
