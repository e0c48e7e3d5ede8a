"""What is known of a robot before any experiment: where it comes to rest, and how it moves about there."""

from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from ..model import StateSpace
from ..rod import Equilibrium


@dataclass(frozen=True, eq=False)
class Pose:
    """A robot at rest.

    Attributes
    ----------
    input
        What is held (m,), N.
    output
        What a sensor without noise measures (p,), m.
    slope
        How that depends on the inputs (p, m), m/N.
    equilibrium
        The rod's, of a robot that is one.
    """

    input: np.ndarray
    output: np.ndarray
    slope: np.ndarray
    equilibrium: Equilibrium | None = field(default=None, repr=False)


class Robot(Protocol):
    """What is known of a robot."""

    @property
    def source(self) -> str:
        """Where this knowledge comes from."""
        ...

    @property
    def neutral(self) -> np.ndarray:
        """Inputs (m,) that do nothing."""
        ...

    def pose(self, given: np.ndarray, near: Pose | None = None) -> Pose:
        """Where it rests under inputs (m,); EquilibriumError where it does not. ``near`` is a pose close by."""
        ...

    def released(self, tip: np.ndarray, bounds: tuple[np.ndarray, np.ndarray]) -> Pose:
        """The pose from which a task releases it; EquilibriumError where it cannot be held there."""
        ...

    def linear(self, pose: Pose) -> StateSpace:
        """Deviations from a pose, sampled."""
        ...

    def slowest(self, pose: Pose) -> tuple[float, float]:
        """Frequency, Hz, and damping ratio of the slowest mode about a pose."""
        ...
