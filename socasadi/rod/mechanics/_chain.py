from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import casadi as ca

from . import _kernels
from ._mesh import Mesh, Node, inertia_at, loads_at
from ._parameters import Parameters

if TYPE_CHECKING:
    from .._rod import Rod

_NO_WRENCH, _NO_OFFSET = ca.DM.zeros(6), ca.DM.zeros(3)


@dataclass(frozen=True, eq=False)
class _Link:
    """A node with the numbers that the kernels take there, DM or expressions of the rod's parameters."""

    node: Node
    rests: tuple[Any, Any]
    inertia: Any
    dead: Any
    follower: Any
    drag: Any
    payloads: tuple[tuple[Any, Any, Any], ...]

    @property
    def interval(self) -> tuple[Any, ...]:
        return (*self.node.bases, *self.rests, self.node.h)

    @property
    def loaded(self) -> bool:
        return not (_vanishes(self.dead) and _vanishes(self.follower))

    @property
    def bare(self) -> bool:
        """Nothing is here that the equations of motion ask for."""
        return not (self.node.weight or self.node.payloads or self.node.point_loads)


class Chain:
    """The recursion along a rod, from base to tip: what depends on poses, velocities and body Jacobians."""

    def __init__(self, rod: Rod, mesh: Mesh, parameters: Parameters) -> None:
        self._rod, self._mesh, self._parameters = rod, mesh, parameters
        self._n = rod.dof

    @cached_property
    def pose(self) -> ca.Function:
        """(q, s) -> (4, 4) homogeneous pose of the section at arc length s, m, clipped to [0, L], world frame."""
        q, s = ca.MX.sym("q", self._n), ca.MX.sym("s")
        kernels = [
            _kernels.pose_kernel(division.strain, division.length, self._parameters.symbols)
            for division in self._rod.divisions
        ]
        R, p = self._base
        for node in self._mesh.nodes:
            start = node.s - node.h
            x, reach = self._mesh.local(node.division, start), ca.fmin(ca.fmax(s - start, 0), node.h)
            R, p = kernels[node.division](R, p, self._own(q, node), x, reach, self._parameters.values)
        pose = ca.blockcat([[R, p], [ca.DM.zeros(1, 3), ca.DM.ones(1)]])
        return self._parameters.function("pose", [q, s], [pose], ["q", "s"], ["pose"])

    @cached_property
    def statics(self) -> ca.Function:
        """q -> (tip rotation (3, 3), tip position (3,), tip body Jacobian (6, n), generalised force (n,) of gravity and
        constant loads, gravitational energy)."""
        q, gravity = ca.MX.sym("q", self._n), self._gravity
        (R, p), J = self._base, ca.MX(6, 0)
        force, potential = ca.MX(ca.DM.zeros(self._n)), ca.MX(0)
        for division, links in zip(self._rod.divisions, self._links, strict=True):
            J = _widened(J, division.dof)
            move, load = _kernels.static_kernel(division.strain, J.shape[1]), _kernels.load_kernel(J.shape[1])
            for link in links:
                R, p, J = move(R, p, J, self._own(q, link.node), *link.interval)
                if link.loaded:
                    force += self._padded(load(R, J, link.dead, link.follower, _NO_OFFSET))
                if link.node.weight:
                    potential -= link.inertia[3] * ca.dot(gravity, p)
                for mass, _, offset in link.payloads:
                    weight = ca.vertcat(ca.DM.zeros(3), mass * gravity)
                    force += self._padded(load(R, J, weight, _NO_WRENCH, offset))
                    potential -= mass * ca.dot(gravity, p + R @ offset)
        outputs = ["rotation", "position", "jacobian", "loads", "potential"]
        return self._parameters.function("statics", [q], [R, p, J, force, potential], ["q"], outputs)

    @cached_property
    def inertia(self) -> ca.Function:
        """(q, v) -> (lower triangle of the mass matrix, inertia less loads (n,), lower triangle of the drag's damping,
        rotation and body Jacobian at the last node that carries anything)."""
        n, q, v = self._n, ca.MX.sym("q", self._n), ca.MX.sym("v", self._n)
        (R, _), J = self._base, ca.MX(6, 0)
        eta, c = ca.MX(ca.DM.zeros(6)), ca.MX(ca.DM.zeros(6))
        mass, bias, damping = ca.MX(n, n), ca.MX(ca.DM.zeros(n)), ca.MX(n, n)
        for division, links in zip(self._rod.divisions, self._links, strict=True):
            J = _widened(J, division.dof)
            columns = J.shape[1]
            move = _kernels.motion_kernel(division.strain, columns)
            weigh = _kernels.slice_kernel(columns, self._rod.drag is not None)
            sums = [ca.MX(columns, columns), ca.MX(ca.DM.zeros(columns)), ca.MX(columns, columns)]
            for link in links:
                if link in self._tail:
                    break
                own = self._own(q, link.node), self._own(v, link.node)
                R, J, eta, c = move(R, J, eta, c, *own, *link.interval)
                parts = []
                if link.node.weight:
                    parts.append(weigh(R, J, eta, c, link.inertia, link.dead, link.follower, link.drag))
                elif link.loaded:
                    parts.append((0, -_kernels.load_kernel(columns)(R, J, link.dead, link.follower, _NO_OFFSET), 0))
                for payload in link.payloads:
                    parts.append((*_kernels.payload_kernel(columns)(R, J, eta, c, *payload, self._gravity), 0))
                for part in parts:
                    sums = [a + b for a, b in zip(sums, part, strict=True)]
            rest = n - columns
            mass += ca.diagcat(sums[0], ca.MX(rest, rest))
            bias += self._padded(sums[1])
            damping += ca.diagcat(sums[2], ca.MX(rest, rest))
        outputs = [mass, bias, damping, R, J]
        return self._parameters.function("inertia", [q, v], outputs, ["q", "v"], ["mass", "bias", "damping", "R", "J"])

    @cached_property
    def tip_load(self) -> ca.Function:
        """(q, R, J, tip) -> generalised force (n,) of a tip load (12,): from the last node that carries anything, whose
        rotation and body Jacobian are given, to the tip."""
        q, tip = ca.MX.sym("q", self._n), ca.MX.sym("tip", 12)
        R0, J0 = ca.MX.sym("R", 3, 3), ca.MX.sym("J", 6, self._n)
        R, J = R0, J0
        for link in self._tail:
            move = _kernels.static_kernel(self._rod.divisions[-1].strain, self._n)
            R, _, J = move(R, ca.DM.zeros(3), J, self._own(q, link.node), *link.interval)
        force = _kernels.load_kernel(self._n)(R, J, tip[:6], tip[6:], _NO_OFFSET)
        return self._parameters.function("tip_load", [q, R0, J0, tip], [force], ["q", "R", "J", "tip"], ["force"])

    @cached_property
    def _links(self) -> list[list[_Link]]:
        """The nodes of each division with their numbers."""
        lift = self._parameters.lift
        drag = self._rod.drag
        links: list[list[_Link]] = [[] for _ in self._rod.divisions]
        for node in self._mesh.nodes:
            strain = self._rod.divisions[node.division].strain
            rests = [lift(rest) for rest in node.rests]
            if strain.constant_rest is not None:
                rests = [ca.DM(0, 1)] * 2
            dead, follower = (lift(ca.vertcat(*wrench)) for wrench in loads_at(self._rod, node))
            coefficients = () if drag is None else (*drag.linear, *drag.quadratic, *drag.angular)
            payloads = tuple(
                (
                    lift(body.mass),
                    lift(ca.blockcat([list(row) for row in body.inertia])),
                    lift(ca.vertcat(*body.offset)),
                )
                for body in node.payloads
            )
            links[node.division].append(
                _Link(
                    node,
                    (rests[0], rests[1]),
                    lift(node.weight * ca.vertcat(*inertia_at(self._rod, node))),
                    dead,
                    follower,
                    lift(node.weight * ca.vertcat(ca.SX(0, 1), *coefficients)),
                    payloads,
                )
            )
        return links

    @cached_property
    def _tail(self) -> list[_Link]:
        """The way from the last node that carries anything to the tip."""
        links = self._links[-1]
        last = max(i for i, link in enumerate(links) if not link.bare)
        return links[last + 1 :]

    @property
    def _base(self) -> tuple[ca.MX, ca.MX]:
        return ca.MX(ca.DM(self._rod.base_rotation)), ca.MX(ca.DM(self._rod.base_position))

    @cached_property
    def _gravity(self) -> Any:
        return self._parameters.lift(ca.vertcat(*self._rod.gravity))

    def _own(self, q: ca.MX, node: Node) -> ca.MX:
        return q[self._mesh.coordinates[node.division]]

    def _padded(self, force: ca.MX) -> ca.MX:
        rest = self._n - force.shape[0]
        return ca.vertcat(force, ca.DM.zeros(rest)) if rest else force


def _widened(J: ca.MX, columns: int) -> ca.MX:
    """The body Jacobian with columns of zeros for the division that begins."""
    return ca.horzcat(J, ca.DM.zeros(6, columns))


def _vanishes(value: Any) -> bool:
    return isinstance(value, ca.DM) and not value.full().any()
