from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np

from .._quadrature import gauss_legendre
from ..body import Cable, Chamber
from ._mesh import Mesh

_TOLERANCE = 1e-10
_MOST_POINTS = 64
_RUBBING_POINTS = 6  # friction varies along a cable even where its route and the strain do not


@dataclass(frozen=True)
class Span:
    """The stretch from ``a`` to ``b`` m of a cable within one piece, with its quadrature (arc length, weight), m."""

    division: int
    a: float
    b: float
    nodes: tuple[tuple[float, float], ...]


def spans_of(cable: Cable | Chamber, mesh: Mesh) -> tuple[Span, ...]:
    """A cable's way through the pieces of a rod.

    As many points in each piece as the cable's length and its derivatives take to converge.
    """
    end = mesh.spans[-1][1] if cable.end is None else cable.end
    spans = []
    for piece in mesh.pieces:
        a, b = max(piece.a, cable.start), min(piece.b, end)
        if a < b and not mesh.same_place(a, b):
            fewest = max(piece.points, _RUBBING_POINTS) if rubs(cable) else piece.points
            spans.append(Span(piece.division, a, b, _converged(cable, a, b, fewest)))
    return tuple(spans)


def rubs(cable: Cable | Chamber) -> bool:
    """Whether there is friction along the cable."""
    return not (isinstance(cable.friction, float | int) and cable.friction == 0)


def route_at(cable: Cable | Chamber, s: float) -> list[ca.SX]:
    """Offset (3,) of the cable in the section at ``s``, its first and its second derivative with respect to s."""
    place, derivatives = _route(cable)
    return ca.substitute(derivatives, [place], [ca.SX(s)])


def _route(cable: Cable | Chamber) -> tuple[ca.SX, list[ca.SX]]:
    place = ca.SX.sym("s")
    offset = ca.SX(ca.vertcat(0, *cable.at(place)))
    slope = ca.jacobian(offset, place)
    return place, [ca.densify(value) for value in (offset, slope, ca.jacobian(slope, place))]


def _converged(cable: Cable | Chamber, a: float, b: float, points: int) -> tuple[tuple[float, float], ...]:
    """Gauss points and weights between ``a`` and ``b`` that integrate the cable's length and moments to rounding."""
    place, (offset, slope, _) = _route(cable)
    along = ca.vertcat(1 + slope[0], slope[1], slope[2])
    speed = ca.norm_2(along)
    symbols = ca.vertcat(ca.SX(0, 1), *(s for s in ca.symvar(offset) if not ca.is_equal(s, place)))
    integrand = ca.Function("integrand", [place, symbols], [ca.vertcat(speed, ca.cross(offset, along / speed))])

    def integrate(count: int) -> tuple[np.ndarray, list[tuple[float, float]]]:
        x, w = gauss_legendre(count)
        nodes = list(zip((a + (b - a) * x).tolist(), ((b - a) * w).tolist(), strict=True))
        # A route's symbols have no values yet; at one they show its shape.
        return sum(w * integrand(s, ca.DM.ones(symbols.shape)).full()[:, 0] for s, w in nodes), nodes  # type: ignore[return-value]

    value, nodes = integrate(points)
    while points < _MOST_POINTS:
        points = min(2 * points, _MOST_POINTS)
        finer, more = integrate(points)
        if np.abs(finer - value).max() <= _TOLERANCE * (1 + np.abs(finer).max()):
            break
        value, nodes = finer, more
    return tuple(nodes)
