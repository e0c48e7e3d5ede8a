from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from .._checks import Number, finite, flag, not_negative, numbers, positive_number, symmetric

_ZERO = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Payload:
    """A rigid body fixed to the rod's axis.

    Parameters
    ----------
    mass
        kg.
    s
        Arc length at which it sits, m; None for the tip.
    inertia
        (3, 3), or three numbers for a diagonal, about its centre of mass and along the section's axes, kg m^2.
    offset
        Centre of mass (3,) from the rod's axis, in the section's axes, m.

    Raises
    ------
    ValueError
        A value is out of range.

    Examples
    --------
    A 50 g gripper whose centre of mass is 20 mm beyond the tip:

    >>> gripper = Payload(0.05, inertia=(1e-5, 2e-5, 2e-5), offset=(0.02, 0, 0))
    """

    mass: Number
    s: float | None = None
    inertia: Any = _ZERO
    offset: tuple[Any, ...] = _ZERO

    def __post_init__(self) -> None:
        not_negative("Payload", mass=self.mass)
        _check_place("Payload", self.s)
        inertia = symmetric("Payload", "inertia", self.inertia, 3, definite=False)
        object.__setattr__(self, "inertia", inertia)
        object.__setattr__(self, "offset", numbers("Payload", "offset", self.offset, 3))


@dataclass(frozen=True)
class PointLoad:
    """A constant force and moment at one point of the axis.

    Parameters
    ----------
    force, moment
        (3,), N and N m.
    s
        Arc length at which it acts, m; None for the tip.
    follower
        False for a dead load, given in the world frame; True for one that turns with the section, given in its axes.

    Raises
    ------
    ValueError
        A value is not finite.

    Examples
    --------
    A 0.2 N thruster at mid-length that pushes along the section's y axis however the rod turns:

    >>> thruster = PointLoad(force=(0, 0.2, 0), s=0.3, follower=True)
    """

    force: tuple[Any, ...] = _ZERO
    moment: tuple[Any, ...] = _ZERO
    s: float | None = None
    follower: bool = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "force", numbers("PointLoad", "force", self.force, 3))
        object.__setattr__(self, "moment", numbers("PointLoad", "moment", self.moment, 3))
        flag("PointLoad", follower=self.follower)
        _check_place("PointLoad", self.s)


@dataclass(frozen=True)
class DistributedLoad:
    """A force and a moment per metre of the unloaded axis.

    Parameters
    ----------
    force, moment
        (3,), N/m and N: numbers, or a function of the arc length s, a number in m, that returns three.
    start, end
        Between which arc lengths it acts, m; None for the tip.
    follower
        False for a dead load, given in the world frame; True for one that turns with the section, given in its axes.

    Raises
    ------
    ValueError
        A value is not finite, or the end is not beyond the start.

    Examples
    --------
    A load that grows linearly to 5 N/m at s = 0.5 m, downwards:

    >>> sand = DistributedLoad(force=lambda s: (0, 0, -10 * s), end=0.5)
    """

    force: tuple[Any, ...] | Callable[[float], Any] = _ZERO
    moment: tuple[Any, ...] | Callable[[float], Any] = _ZERO
    start: float = 0.0
    end: float | None = None
    follower: bool = False

    def __post_init__(self) -> None:
        for name in ("force", "moment"):
            if not callable(given := getattr(self, name)):
                object.__setattr__(self, name, numbers("DistributedLoad", name, given, 3))
        check_span("DistributedLoad", self.start, self.end)
        flag("DistributedLoad", follower=self.follower)

    def at(self, s: float) -> tuple[Any, ...]:
        """Moment and force per metre (6,) at ``s``."""
        both = []
        for name in ("moment", "force"):
            given = getattr(self, name)
            try:
                value = given(s) if callable(given) else given
            except Exception as error:
                raise ValueError(f"DistributedLoad: {name} fails at s = {s:g} m: {error}") from error
            both += numbers("DistributedLoad", f"{name}({s:g})", value, 3)
        return tuple(both)


@dataclass(frozen=True)
class Drag:
    """What a fluid at rest does to a moving rod: a force per metre against the section's velocity.

    Per metre of the rod, along its tangent and along either normal, with v the axis' velocity in the section's axes,

        f_t = -linear[0] v_t - quadratic[0] |v_t| v_t,     f_n = -linear[1] v_n - quadratic[1] |v_n| v_n,

    and a moment -angular times the angular velocity. The linear term is resistive-force theory (slow flow; Gray and
    Hancock 1955), the quadratic one Morison's with quadratic[1] = rho C d / 2 for a fluid of density rho, a drag
    coefficient C and a diameter d.

    Parameters
    ----------
    linear
        Tangential and normal coefficient, N s/m^2.
    quadratic
        Tangential and normal coefficient, N s^2/m^3.
    angular
        About tangent and normals, N s.

    Raises
    ------
    ValueError
        A coefficient is negative or not finite.

    Examples
    --------
    A rod of 6 cm diameter under water, drag coefficient 1.1:

    >>> water = Drag(quadratic=(0.0, 1000 * 1.1 * 0.06 / 2))
    """

    linear: tuple[Any, Any] = (0.0, 0.0)
    quadratic: tuple[Any, Any] = (0.0, 0.0)
    angular: tuple[Any, Any] = (0.0, 0.0)

    def __post_init__(self) -> None:
        for name in ("linear", "quadratic", "angular"):
            tangential, normal = numbers("Drag", name, getattr(self, name), 2)
            not_negative("Drag", **{f"{name}[0]": tangential, f"{name}[1]": normal})
            object.__setattr__(self, name, (tangential, normal))


def check_span(owner: str, start: Any, end: Any) -> None:
    """ValueError unless 0 <= start < end, in m; an end of None is the tip."""
    not_negative(owner, start=start)
    if end is not None:
        finite(owner, end=end)
        if end <= start:
            raise ValueError(f"{owner}: end is {end!r} m, but must be beyond the start, {start!r} m")


def _check_place(owner: str, s: Any) -> None:
    if s is not None:
        positive_number(owner, s=s)
