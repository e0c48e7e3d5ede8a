from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, Any

import casadi as ca
import numpy as np

from .._quadrature import gauss_legendre
from ..body import Cable, Chamber
from . import _kernels
from ._mesh import Mesh
from ._parameters import Parameters
from ._routing import Span, route_at, rubs, spans_of

if TYPE_CHECKING:
    from .._rod import Rod


class Actuation:
    """The cables and chambers of a rod: lengths, generalised forces, and the tension that an input comes to."""

    def __init__(self, rod: Rod, mesh: Mesh, parameters: Parameters) -> None:
        self._rod, self._mesh, self._parameters = rod, mesh, parameters

    @cached_property
    def columns(self) -> ca.Function:
        """q -> (generalised force per unit of tension (n, cables), lengths (cables,))"""
        rod, q = self._rod, ca.MX.sym("q", self._rod.dof)
        # Cables that share their nodes go through the kernels together.
        groups: dict[tuple[tuple[Span, ...], bool], list[int]] = {}
        for i, cable in enumerate(rod.cables):
            groups.setdefault((spans_of(cable, self._mesh), rubs(cable)), []).append(i)
        columns: dict[int, ca.MX] = {}
        lengths: dict[int, ca.MX] = {}
        for (spans, rubbing), members in groups.items():
            actuation, length = self._group(q, [rod.cables[i] for i in members], spans, rubbing)
            columns |= dict(zip(members, ca.horzsplit(actuation), strict=True))
            lengths |= dict(zip(members, ca.vertsplit(length), strict=True))
        actuation = ca.horzcat(ca.MX(rod.dof, 0), *(columns[i] for i in range(len(rod.cables))))
        length = ca.vertcat(ca.MX(0, 1), *(lengths[i] for i in range(len(rod.cables))))
        return self._parameters.function("cables", [q], [actuation, length], ["q"], ["actuation", "lengths"])

    def tension(self, lengths: ca.MX, u: ca.MX) -> tuple[ca.MX, ca.MX]:
        """Tension of each cable (pressure of each chamber), and its derivative with respect to the cable's length."""
        tensions, springs = [ca.MX(0, 1)], [ca.MX(0, 1)]
        for i, cable in enumerate(self._rod.cables):
            tension, spring = u[i], ca.MX(0)
            if isinstance(cable, Cable) and cable.drive == "length":
                spring, excess = ca.MX(self._parameters.lift(cable.stiffness)), lengths[i] - u[i]
                if cable.slack:
                    excess, spring = ca.fmax(excess, 0), spring * (excess > 0)
                tension = self._parameters.lift(cable.stiffness) * excess
            tensions.append(tension)
            springs.append(spring)
        return ca.vertcat(*tensions), ca.vertcat(*springs)

    @property
    def by_length(self) -> bool:
        """Whether any cable is driven by its length."""
        return any(cable.drive == "length" for cable in self._rod.cables)

    def _group(
        self, q: ca.MX, cables: list[Cable | Chamber], spans: tuple[Span, ...], rubbing: bool
    ) -> tuple[ca.MX, ca.MX]:
        """Columns (n, cables) and lengths of cables that have the same nodes."""
        m, divisions = len(cables), self._rod.divisions
        blocks = [ca.MX(ca.DM.zeros(division.dof, m)) for division in divisions]
        length, turned = ca.MX(ca.DM.zeros(m)), ca.MX(ca.DM.zeros(m))
        pulls = self._parameters.lift(ca.vertcat(*(cable.pull for cable in cables)))
        for span in spans:
            own = q[self._mesh.coordinates[span.division]]
            kernel = _kernels.cable_kernel(divisions[span.division].strain, m)
            remaining = [pulls] * len(span.nodes)
            if rubbing:
                factors, turned = self._capstan(own, cables, span, turned)
                remaining = [pulls * factor for factor in factors]
            for (s, weight), pull in zip(span.nodes, remaining, strict=True):
                offsets, slopes, _ = self._routes(cables, s)
                basis, _, rest, _ = self._strain(span.division, s)
                part, piece = kernel(own, basis, rest, offsets, slopes, weight, pull)
                blocks[span.division] += part
                length += piece
        return ca.vertcat(*blocks), length

    def _capstan(
        self, own: ca.MX, cables: list[Cable | Chamber], span: Span, turned: ca.MX
    ) -> tuple[list[ca.MX], ca.MX]:
        """What friction leaves of the tension at each node, exp(-friction x angle turned since the start), and the
        angle turned up to the end of the span."""
        friction = self._parameters.lift(ca.vertcat(*(cable.friction for cable in cables)))
        kernel = _kernels.turning_kernel(self._rod.divisions[span.division].strain, len(cables))
        rates = [kernel(own, *self._strain(span.division, s), *self._routes(cables, s)) for s, _ in span.nodes]
        rate = (span.b - span.a) * ca.horzcat(*rates)
        angles = ca.repmat(turned, 1, len(rates)) + rate @ ca.DM(_running_integrals(len(rates)))
        weights = ca.DM(gauss_legendre(len(rates))[1])
        return [ca.exp(-friction * angle) for angle in ca.horzsplit(angles)], turned + rate @ weights

    def _routes(self, cables: list[Cable | Chamber], s: float) -> list[Any]:
        """Offsets, slopes and curves (3, cables) at ``s``."""
        routes = [route_at(cable, s) for cable in cables]
        return [self._parameters.lift(ca.horzcat(*(route[k] for route in routes))) for k in range(3)]

    def _strain(self, division: int, s: float) -> tuple[ca.DM, ca.DM, Any, Any]:
        """Basis and its derivative with respect to s; rest strain (empty if the kernels know it) and its derivative."""
        strain, span = self._rod.divisions[division].strain, self._rod.divisions[division].length
        x, at = ca.SX.sym("x"), ca.SX(self._mesh.local(division, s))
        values, rest = strain.values(x), strain.rest_at(x)
        along = [values, ca.jacobian(values, x) / span, rest, ca.jacobian(rest, x) / span]
        here = [ca.densify(value) for value in ca.substitute(along, [x], [at])]
        basis, basis_rate = (ca.DM(strain.sparsity, ca.evalf(value)) for value in here[:2])
        given = ca.DM(0, 1) if strain.constant_rest is not None else self._parameters.lift(here[2])
        return basis, basis_rate, given, self._parameters.lift(here[3])


def _running_integrals(points: int) -> np.ndarray:
    """Matrix (points, points): values at the Gauss points times column j integrate from 0 to the j-th of them."""
    t = 2 * gauss_legendre(points)[0] - 1
    legendre = np.polynomial.legendre.legvander(t, points)
    # The integral of P_k from -1 to t is (P_{k+1}(t) - P_{k-1}(t)) / (2 k + 1), with P_{-1} = -1 for k = 0.
    below = np.column_stack([-np.ones(points), legendre[:, : points - 1]])
    integrals = (legendre[:, 1:] - below) / (2 * np.arange(points) + 1)
    return np.linalg.solve(legendre[:, :points].T, integrals.T / 2)
