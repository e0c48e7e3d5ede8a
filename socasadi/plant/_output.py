from dataclasses import dataclass
from math import isfinite
from typing import Protocol

import casadi as ca

from ..rod import Rod


class Output(Protocol):
    """What a sensor sees of the tip: a frozen dataclass whose fields are plain numbers."""

    @property
    def size(self) -> int:
        """Number of measured values."""
        ...

    def check(self, rod: Rod) -> None:
        """ValueError when this sensor cannot see this rod."""
        ...

    def measure(self, pose: ca.MX) -> ca.MX:
        """Measured values (size,) without noise as an expression of the tip's homogeneous pose (4, 4).

        Not a number (NaN) where the sensor sees nothing.
        """
        ...


@dataclass(frozen=True)
class TipDisplacement:
    """The tip's displacement (y, z) from the straight rod's axis, m, in the base frame."""

    @property
    def size(self) -> int:
        return 2

    def check(self, rod: Rod) -> None:
        pass

    def measure(self, pose: ca.MX) -> ca.MX:
        return pose[1:3, 3]


@dataclass(frozen=True)
class LaserSpot:
    """Where a laser at the tip, pointing along the tip's tangent, meets a screen.

    The screen is the plane x = ``distance`` of the base frame, perpendicular to the straight rod. With the tip at p
    and its tangent t (the x axis of the tip section) the spot is p + t (distance - p_x) / t_x; its (y, z), m, is
    measured, (0, 0) for the straight rod. A tip that looks away from the screen, or has passed it, has no spot.

    Parameters
    ----------
    distance
        From the base to the screen, m; more than the rod's length.
    """

    distance: float

    def __post_init__(self) -> None:
        if not (isfinite(self.distance) and self.distance > 0):
            raise ValueError(f"LaserSpot: distance is {self.distance!r} m, but must be a finite number above zero")

    @property
    def size(self) -> int:
        return 2

    def check(self, rod: Rod) -> None:
        if self.distance <= rod.length:
            raise ValueError(
                f"LaserSpot: the screen is at distance {self.distance:g} m, but must be beyond the rod's tip, "
                f"{rod.length:g} m from the base"
            )

    def measure(self, pose: ca.MX) -> ca.MX:
        tip, tangent = pose[:3, 3], pose[:3, 0]
        ahead = self.distance - tip[0]
        visible = ca.logic_and(tangent[0] > 0, ahead > 0)
        reach = ca.if_else(visible, ahead / tangent[0], ca.DM.nan())
        return tip[1:] + reach * tangent[1:]
