from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING

import casadi as ca
import numpy as np

from .._checks import Number
from .._quadrature import gauss_legendre
from .._validation import PLACE_TOLERANCE
from ..body import DistributedLoad, Payload, PointLoad
from ._kernels import GAUSS_POINTS

if TYPE_CHECKING:
    from .._rod import Rod


@dataclass(frozen=True)
class Piece:
    """A stretch of the rod, from ``a`` to ``b`` m, within which strain and loads are smooth."""

    division: int
    a: float
    b: float
    points: int

    @property
    def length(self) -> float:
        return self.b - self.a


@dataclass(frozen=True, eq=False)
class Node:
    """A place that the recursion along the rod stops at, and the interval of length ``h`` m that leads there.

    ``x`` is its place ``s`` as a fraction of its division. ``weight`` is the quadrature weight, m, zero where the node
    is only the end of a piece or carries a load. Basis and rest strain are those at the interval's two Gauss points.
    """

    division: int
    s: float
    x: float
    h: float
    weight: float
    bases: tuple[ca.DM, ca.DM]
    rests: tuple[ca.SX, ca.SX]
    payloads: tuple[Payload, ...]
    point_loads: tuple[PointLoad, ...]


class Mesh:
    """Where along the rod the equations are evaluated: Gauss points of each piece, ends of pieces, and loads."""

    def __init__(self, rod: Rod) -> None:
        self._rod = rod
        ends = np.cumsum([division.length for division in rod.divisions])
        self.spans = list(pairwise([0.0, *ends.tolist()]))
        """Where each division begins and ends, m."""
        ends = np.cumsum([0, *(division.dof for division in rod.divisions)]).tolist()
        self.coordinates = [slice(a, b) for a, b in pairwise(ends)]
        """Which of the rod's coordinates are each division's own."""

    @cached_property
    def pieces(self) -> list[Piece]:
        rod = self._rod
        cuts = [edge for load in rod.loads if isinstance(load, DistributedLoad) for edge in (load.start, load.end)]
        pieces = []
        for index, ((start, end), division) in enumerate(zip(self.spans, rod.divisions, strict=True)):
            breaks = [start + x * division.length for x in division.strain.breaks]
            inner = [s for s in (*breaks, *cuts) if s is not None and start < s < end and not self.same_place(s, end)]
            for a, b in pairwise(self._distinct([start, *inner, end])):
                pieces.append(Piece(index, a, b, division.points_in((b - a) / division.length)))
        return pieces

    @cached_property
    def nodes(self) -> list[Node]:
        rod, nodes = self._rod, list[Node]()
        marks = [self._mark(body) for body in (*rod.payloads, *rod.loads) if not isinstance(body, DistributedLoad)]
        for piece in self.pieces:
            x, w = gauss_legendre(piece.points)
            stops = [(s, weight) for s, weight in zip(piece.a + piece.length * x, piece.length * w, strict=True)]
            stops += [(s, 0.0) for s in (*marks, piece.b) if piece.a < s <= piece.b]
            start = piece.a
            for s in self._distinct([s for s, _ in stops]):
                weight = sum(w for place, w in stops if self.same_place(place, s))
                nodes.append(self._node(piece, start, s, float(weight)))
                start = s
        return nodes

    def local(self, division: int, s: float) -> float:
        """Arc length ``s`` as the fraction x of its division."""
        start, end = self.spans[division]
        return (s - start) / (end - start)

    def _node(self, piece: Piece, start: float, stop: float, weight: float) -> Node:
        rod, h = self._rod, stop - start
        strain = rod.divisions[piece.division].strain
        x = [self.local(piece.division, start + c * h) for c in GAUSS_POINTS]
        a, b = (ca.DM(strain.sparsity, values) for values in strain.tabulate(np.array(x)))
        here = [
            body
            for body in (*rod.payloads, *rod.loads)
            if not isinstance(body, DistributedLoad) and self.same_place(self._mark(body), stop)
        ]
        return Node(
            piece.division,
            stop,
            self.local(piece.division, stop),
            h,
            weight,
            (a, b),
            (strain.rest_at(ca.SX(x[0])), strain.rest_at(ca.SX(x[1]))),
            tuple(body for body in here if isinstance(body, Payload)),
            tuple(body for body in here if isinstance(body, PointLoad)),
        )

    def _mark(self, body: Payload | PointLoad) -> float:
        """Where something sits; at a piece's end if rounding alone keeps it from there."""
        s = self._rod.length if body.s is None else body.s
        return next((piece.b for piece in self.pieces if self.same_place(piece.b, s)), s)

    def same_place(self, s: float, other: float) -> bool:
        """Whether two arc lengths differ by rounding alone."""
        return abs(s - other) <= PLACE_TOLERANCE * self._rod.length

    def _distinct(self, places: list[float]) -> list[float]:
        """``places`` in order, those that rounding alone tells apart taken as one."""
        ordered = sorted(float(s) for s in places)
        return ordered[:1] + [b for a, b in pairwise(ordered) if not self.same_place(a, b)]


def loads_at(rod: Rod, node: Node) -> tuple[list[Number], list[Number]]:
    """Dead and follower wrench (6,) each, moment first, that act at a node, gravity of the slice around it included."""
    dead: list[Number] = [0.0] * 6
    follower: list[Number] = [0.0] * 6
    wrenches: list[tuple[bool, tuple[Number, ...]]] = []
    for load in node.point_loads:
        wrenches.append((load.follower, (*load.moment, *load.force)))
    for load in rod.loads:
        if node.weight and isinstance(load, DistributedLoad) and load.start < node.s < (load.end or rod.length):
            wrenches.append((load.follower, tuple(node.weight * value for value in load.at(node.s))))
    if node.weight:
        mass = node.weight * inertia_at(rod, node)[3]
        wrenches.append((False, (0.0, 0.0, 0.0, *(mass * g for g in rod.gravity))))
    for follows, wrench in wrenches:
        total = follower if follows else dead
        total[:] = [a + b for a, b in zip(total, wrench, strict=True)]
    return dead, follower


def inertia_at(rod: Rod, node: Node) -> list[Number]:
    """Diagonal (6,) of the section's mass matrix per metre at a node."""
    return rod.divisions[node.division].inertia_at(node.x)
