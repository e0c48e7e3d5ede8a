from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import cos, pi, sin
from typing import Any, Literal

import casadi as ca

from .._checks import Number, finite, flag, not_negative, numbers, positive, symbolic, whole
from ._load import check_span

Route = tuple[Any, Any] | Callable[[Any], Any]
"""Where a cable runs in the section: (y, z), m, or a function of the arc length s in m that returns them."""


@dataclass(frozen=True)
class Converging:
    """A route along a straight line from (y, z) = ``base`` at s = 0 to ``tip`` at s = ``length``, m.

    Examples
    --------
    >>> Cable(Converging(base=(0.02, 0), tip=(0.005, 0), length=0.6)).at(0.3)
    (0.0125, 0.0)
    """

    base: tuple[Any, Any]
    tip: tuple[Any, Any]
    length: float

    def __post_init__(self) -> None:
        positive("Converging", length=self.length)
        for name in ("base", "tip"):
            object.__setattr__(self, name, numbers("Converging", name, getattr(self, name), 2))

    def __call__(self, s: Any) -> tuple[Any, Any]:
        y, z = (a + (b - a) * s / self.length for a, b in zip(self.base, self.tip, strict=True))
        return y, z


@dataclass(frozen=True)
class Helix:
    """A route around the axis at ``radius``, m, one turn in ``pitch``, m; it starts at ``angle``, rad, from +y.

    A positive pitch turns from +y towards +z. A helical cable that is pulled twists the rod.

    Examples
    --------
    >>> y, z = Cable(Helix(radius=0.02, pitch=0.4)).at(0.1)
    >>> print(f"{y:.3f} {z:.3f}")
    0.000 0.020
    """

    radius: Number
    pitch: Number
    angle: Number = 0.0

    def __post_init__(self) -> None:
        finite("Helix", radius=self.radius, pitch=self.pitch, angle=self.angle)
        if not symbolic(self.pitch) and self.pitch == 0:
            raise ValueError("Helix: pitch is 0 m, but must not be zero")

    def __call__(self, s: Any) -> tuple[Any, Any]:
        angle = self.angle + 2 * pi / self.pitch * s
        return self.radius * ca.cos(angle), self.radius * ca.sin(angle)


@dataclass(frozen=True)
class Cable:
    """A cable in the rod, frictionless unless said, fixed where it ends; a positive tension pulls.

    Parameters
    ----------
    route
        (y, z), m, for a cable parallel to the axis; or a function of the arc length s, m, written so that it takes
        a CasADi symbol, that returns (y, z), such as :class:`Converging` and :class:`Helix`.
    start, end
        Arc lengths, m, where it enters the rod and where it is fixed; None for the tip.
    friction
        Coefficient of friction mu along the routing. The tension falls from the start by the capstan law
        exp(-mu times the angle that the cable has turned through), which holds while the cable is being pulled.
        Kinks where a strain jumps are not counted in that angle.
    drive
        "tension": the input is the tension, N, and a negative one pushes. "length": the input is the length, m, that
        the actuator leaves between start and end: a shorter one pulls, with the tension
        ``stiffness`` (length - input). The shorter the substep of the simulation, the stiffer it may be: some
        1e5 N/m for a rod like the preset "paper" at the default substep.
    stiffness
        Of a cable driven by length, N/m: E A / length of the wire between actuator and end.
    slack
        Whether a cable driven by length goes slack rather than push.

    Raises
    ------
    ValueError
        A value is out of range, or the route cannot take a CasADi symbol.

    Examples
    --------
    >>> import casadi as ca
    >>> straight = Cable((0.02, 0.0))
    >>> half_length = Cable((0.0, 0.02), end=0.3)
    >>> wavy = Cable(lambda s: (0.02 * ca.cos(3 * s), 0.01))
    >>> rubbing = Cable(Helix(radius=0.02, pitch=0.3), friction=0.1)
    >>> servo = Cable((0.02, 0.0), drive="length", stiffness=5e4)
    """

    route: Route
    start: float = 0.0
    end: float | None = None
    friction: Number = 0.0
    drive: Literal["tension", "length"] = "tension"
    stiffness: Number | None = None
    slack: bool = True

    def __post_init__(self) -> None:
        _check_route(self, "Cable")
        not_negative("Cable", friction=self.friction)
        flag("Cable", slack=self.slack)
        if self.drive not in ("tension", "length"):
            raise ValueError(f"Cable: drive is {self.drive!r}, but must be 'tension' or 'length'")
        if self.drive == "length":
            positive("Cable", stiffness=self.stiffness)
        elif self.stiffness is not None:
            raise ValueError(
                f"Cable: stiffness is {self.stiffness!r}, but a cable driven by tension has none; "
                "set drive='length' for a cable of given length"
            )

    @property
    def pull(self) -> Number:
        """Newtons that one unit of tension pulls with."""
        return 1.0

    def at(self, s: Any) -> tuple[Any, Any]:
        """Where it runs in the section at arc length ``s``: (y, z), m."""
        return _position(self.route, s)


@dataclass(frozen=True)
class Chamber:
    """A pneumatic or hydraulic chamber along the rod: a pressure above that around it pushes, below it pulls.

    Its generalised force is the pressure times the derivative of the chamber's volume, area times the length of its
    centre line.

    Parameters
    ----------
    route
        Of the centre line of the chamber, as in :class:`Cable`.
    area
        Of the chamber's own section, m^2. The input is the pressure, Pa.
    start, end
        Arc lengths, m, between which it lies; None for the tip.

    Raises
    ------
    ValueError
        A value is out of range, or the route cannot take a CasADi symbol.

    Examples
    --------
    Three chambers of 1 cm^2, the first on +y:

    >>> chambers = tuple(Chamber(cable.route, area=1e-4) for cable in cables_around(3, 0.02))
    """

    route: Route
    area: Number
    start: float = 0.0
    end: float | None = None

    friction = 0.0
    drive = "tension"

    def __post_init__(self) -> None:
        _check_route(self, "Chamber")
        positive("Chamber", area=self.area)

    @property
    def pull(self) -> Number:
        """Newtons that one unit of pressure pulls with: a chamber pushes."""
        return -self.area

    def at(self, s: Any) -> tuple[Any, Any]:
        """Where it runs in the section at arc length ``s``: (y, z), m."""
        return _position(self.route, s)


def cables_around(count: int, offset: Number) -> tuple[Cable, ...]:
    """``count`` cables at ``offset`` m from the axis, evenly spaced, the first on +y, turning towards +z."""
    count = whole("cables_around", "count", count, 1)
    positive("cables_around", offset=offset)
    angles = [2 * pi * i / count for i in range(count)]
    return tuple(Cable((offset * cos(angle), offset * sin(angle))) for angle in angles)


def _position(route: Route, s: Any) -> tuple[Any, Any]:
    place = route(s) if callable(route) else route
    y, z = ca.vertsplit(place) if isinstance(place, ca.SX | ca.DM) else place
    return y, z


def _check_route(cable: Cable | Chamber, owner: str) -> None:
    check_span(owner, cable.start, cable.end)
    if not callable(cable.route):
        object.__setattr__(cable, "route", numbers(owner, "route", cable.route, 2))
        return
    s = ca.SX.sym("s")
    try:
        y, z = cable.at(s)
        finite(owner, y=ca.SX(y), z=ca.SX(z))
    except Exception as error:
        raise ValueError(
            f"{owner}: the route does not give two expressions for a CasADi symbol s ({error}); "
            "write it with casadi's functions, as in lambda s: (0.02 * ca.cos(s), 0.02 * ca.sin(s))"
        ) from error
