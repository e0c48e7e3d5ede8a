from dataclasses import dataclass
from math import isfinite
from typing import Protocol

import casadi as ca
import numpy as np

from ..rod import Rod


class Output(Protocol):
    """What a sensor sees of the tip: a frozen dataclass whose fields are plain numbers.

    One whose values are not metres says so by an attribute ``unit``, a text.
    """

    @property
    def size(self) -> int:
        """Number of measured values."""
        ...

    def check(self, rod: Rod) -> None:
        """ValueError when this sensor cannot see this rod."""
        ...

    def measure(self, pose: ca.MX) -> ca.MX:
        """Measured values (size,) without noise as an expression of the tip's homogeneous pose (4, 4), base frame.

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


@dataclass(frozen=True)
class Camera:
    """Where a camera that stands still sees the tip: (right, down) of the centre of its image, pixels.

    An ideal pinhole: a point at depth z along the optical axis and at (x, y) to the right of and below it is seen at
    ``focal_length`` (x, y) / z. A tip that is not in front of the camera is not seen.

    Parameters
    ----------
    position
        Of the camera (3,), m, base frame.
    target
        A point (3,) on the optical axis in front of it, m: what it looks at.
    focal_length
        Pixels: the lens's focal length over the size of a pixel.
    up
        Direction (3,) that is upright in the image, base frame.

    Raises
    ------
    ValueError
        A value is not finite, the focal length is not above zero, the target is at the camera, or ``up`` is along
        the optical axis.

    Examples
    --------
    From a metre before the tip of a rod of 0.6 m, looking at it; a millimetre there is half a pixel:

    >>> camera = Camera(position=(1.6, 0, 0), target=(0.6, 0, 0), focal_length=500)
    """

    position: tuple[float, float, float]
    target: tuple[float, float, float]
    focal_length: float
    up: tuple[float, float, float] = (0.0, 0.0, 1.0)

    def __post_init__(self) -> None:
        for name in ("position", "target", "up"):
            value = np.asarray(getattr(self, name), dtype=float)
            if value.shape != (3,) or not np.isfinite(value).all():
                raise ValueError(f"Camera: {name} is {getattr(self, name)!r}, but must be 3 finite numbers")
            object.__setattr__(self, name, tuple(value.tolist()))
        if not (isfinite(self.focal_length) and self.focal_length > 0):
            raise ValueError(f"Camera: focal_length is {self.focal_length!r} pixels, but must be above zero")
        if not np.isfinite(self._axes).all():
            raise ValueError(
                f"Camera: target {self.target} and up {self.up} must give a line of sight from {self.position} "
                "and a direction that is not along it"
            )

    @property
    def size(self) -> int:
        return 2

    @property
    def unit(self) -> str:
        """Of the measured values."""
        return "px"

    def check(self, rod: Rod) -> None:
        pass

    def measure(self, pose: ca.MX) -> ca.MX:
        seen = ca.DM(self._axes) @ (pose[:3, 3] - ca.DM(self.position))
        return self.focal_length * seen[:2] / ca.if_else(seen[2] > 0, seen[2], ca.DM.nan())

    @property
    def _axes(self) -> np.ndarray:
        """Rows: the camera's right, down and forward; not finite where they are not defined."""
        forward = np.subtract(self.target, self.position)
        right = np.cross(forward, self.up)
        axes = np.array([right, np.cross(forward, right), forward])
        size = np.linalg.norm(axes, axis=1, keepdims=True)
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(size > 1e-12, axes / size, np.nan)
