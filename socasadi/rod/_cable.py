from dataclasses import dataclass
from math import cos, hypot, pi, sin

import numpy as np

from ._checks import finite


@dataclass(frozen=True)
class Cable:
    """A cable parallel to the rod's axis, fixed at the tip; a positive tension pulls, a negative one pushes.

    Parameters
    ----------
    y, z
        Where it runs in the section, m.

    Notes
    -----
    The model asks a cable only for :meth:`path`; another routing is another class with that method.

    Raises
    ------
    ValueError
        The offset is not finite.
    """

    y: float
    z: float

    def __post_init__(self) -> None:
        finite("Cable", y=self.y, z=self.z)

    @property
    def offset(self) -> float:
        """Distance from the axis, m."""
        return hypot(self.y, self.z)

    def path(self, s: float) -> tuple[np.ndarray, np.ndarray]:
        """Offset (3,) in the section at arc length ``s`` m, and its derivative (3,) with respect to s."""
        return np.array([0.0, self.y, self.z]), np.zeros(3)


def cables_around(count: int, offset: float) -> tuple[Cable, ...]:
    """``count`` cables at ``offset`` m from the axis, evenly spaced, the first on +y, turning towards +z."""
    angles = [2 * pi * i / count for i in range(count)]
    return tuple(Cable(offset * cos(angle), offset * sin(angle)) for angle in angles)
