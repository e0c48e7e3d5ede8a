from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

import casadi as ca

from . import _kernels
from ._actuation import Actuation
from ._chain import Chain
from ._elasticity import integral
from ._mesh import Mesh
from ._parameters import Parameters

if TYPE_CHECKING:
    from .._rod import Rod

TIP_LOADS = 12
"""Entries of a tip load: dead moment and force in the world frame, follower moment and force in the tip's axes."""


class RodModel:
    """The equations of a rod as CasADi Functions, built when first asked for.

    With q the strain coordinates (n,), v their rates, x = [q; v] the state and u the inputs (tensions in newtons,
    pressures in pascals, lengths in metres, as :class:`Cable` and :class:`Chamber` say), one entry a cable,

        mass(q) dv/dt + bias(q, v) = actuation(q) tension,     tension = tensions(q, u),

    where tension = u unless a cable is driven by its length. A rod whose symbolic parameters have no values takes them
    as one more argument of each Function, p (parameters,). All Functions take numbers or CasADi symbols and can be
    differentiated in every argument. Their C is small: call :func:`socasadi.codegen.compiled` on any.
    """

    def __init__(self, rod: Rod) -> None:
        self._rod = rod
        self._mesh = Mesh(rod)
        self._parameters = Parameters(rod)
        self._chain = Chain(rod, self._mesh, self._parameters)
        self._actuation = Actuation(rod, self._mesh, self._parameters)
        n = rod.dof
        self._q, self._v = ca.MX.sym("q", n), ca.MX.sym("v", n)
        self._x, self._u = ca.MX.sym("x", 2 * n), ca.MX.sym("u", len(rod.cables))

    # Kinematics

    @property
    def pose(self) -> ca.Function:
        """(q, s) -> (4, 4) homogeneous pose of the section at arc length s, m, clipped to [0, L], world frame."""
        return self._chain.pose

    @cached_property
    def tip(self) -> ca.Function:
        """q -> (3,) position of the tip, m, world frame."""
        return self._function("tip", [self._q], [self.statics(self._q, *self.free)[1]], ["q"], ["tip"])

    @cached_property
    def twist(self) -> ca.Function:
        """(q, v, s) -> (6,) angular velocity, rad/s, and velocity, m/s, of the section at s, in its own axes."""
        q, v, s = self._q, self._v, ca.MX.sym("s")
        pose = self.pose(q, s, *self.free)
        rate = ca.reshape(ca.jtimes(ca.vec(pose), q, v), 4, 4)
        turning, moving = pose[:3, :3].T @ rate[:3, :3], pose[:3, :3].T @ rate[:3, 3]
        twist = ca.vertcat(turning[2, 1], turning[0, 2], turning[1, 0], moving)
        return self._function("twist", [q, v, s], [twist], ["q", "v", "s"], ["twist"])

    @cached_property
    def velocity(self) -> ca.Function:
        """(q, v, s) -> (3,) velocity, m/s, of the axis at arc length s, m, world frame."""
        q, v, s = self._q, self._v, ca.MX.sym("s")
        velocity = ca.jtimes(self.pose(q, s, *self.free)[:3, 3], q, v)
        return self._function("velocity", [q, v, s], [velocity], ["q", "v", "s"], ["velocity"])

    @cached_property
    def strain(self) -> ca.Function:
        """(q, s) -> (6,) strain (kx, ky, kz in 1/m, sx, sy, sz) at arc length s, m, clipped to [0, L]."""
        q, s, xi = ca.SX.sym("q", self._rod.dof), ca.SX.sym("s"), ca.SX(6, 1)
        for division, own, (start, end) in zip(
            self._rod.divisions, self._mesh.coordinates, self._mesh.spans, strict=True
        ):
            strain, x = division.strain, ca.fmin(ca.fmax((s - start) / (end - start), 0), 1)
            here = strain.rest_at(x) + ca.SX(strain.sparsity, strain.values(x)) @ q[own]
            xi = ca.if_else(s >= start, here, xi) if start else here
        local = ca.Function("strain", [q, s, self._parameters.symbols], [ca.densify(xi)])
        q, s = self._q, ca.MX.sym("s")
        return self._function("strain", [q, s], [local(q, s, self._parameters.values)], ["q", "s"], ["strain"])

    # Dynamics

    @cached_property
    def mass(self) -> ca.Function:
        """q -> (n, n) mass matrix, symmetric positive definite, dense."""
        lower = self._chain.inertia(self._q, ca.DM.zeros(self._rod.dof), *self.free)[0]
        return self._function("mass", [self._q], [ca.densify(ca.tril2symm(lower))], ["q"], ["mass"])

    @cached_property
    def bias(self) -> ca.Function:
        """(q, v) -> (n,) generalised force of inertia, elasticity, damping and drag, less gravity and loads."""
        q, v = self._q, self._v
        bias = self._chain.inertia(q, v, *self.free)[1] + self._elastic_and_viscous(q, v)
        return self._function("bias", [q, v], [bias], ["q", "v"], ["bias"])

    @cached_property
    def actuation(self) -> ca.Function:
        """q -> (n, cables) generalised force per newton of tension, per pascal of a chamber's pressure.

        Without friction it is minus the derivative of the cable lengths.
        """
        columns = self._actuation.columns(self._q, *self.free)[0]
        return self._function("actuation", [self._q], [columns], ["q"], ["actuation"])

    @cached_property
    def cable_lengths(self) -> ca.Function:
        """q -> (cables,) lengths between start and end, m."""
        lengths = self._actuation.columns(self._q, *self.free)[1]
        return self._function("cable_lengths", [self._q], [lengths], ["q"], ["lengths"])

    @cached_property
    def cable_rates(self) -> ca.Function:
        """(q, v) -> (cables,) rates of change of the lengths, m/s."""
        rates = ca.jtimes(self.cable_lengths(self._q, *self.free), self._q, self._v)
        return self._function("cable_rates", [self._q, self._v], [rates], ["q", "v"], ["rates"])

    @cached_property
    def tensions(self) -> ca.Function:
        """(q, u) -> (cables,) tensions, N, and pressures, Pa: the inputs, or what cables driven by length come to."""
        tension, _ = self._actuation.tension(self.cable_lengths(self._q, *self.free), self._u)
        return self._function("tensions", [self._q, self._u], [tension], ["q", "u"], ["tensions"])

    @cached_property
    def forward_dynamics(self) -> ca.Function:
        """(q, v, u) -> (n,) dv/dt."""
        q, v, u = self._q, self._v, self._u
        mass, force, *_ = self.motion(ca.vertcat(q, v), u, *self.free)
        return self._function("forward_dynamics", [q, v, u], [self.solve(mass, force)], ["q", "v", "u"], ["a"])

    @cached_property
    def inverse_dynamics(self) -> ca.Function:
        """(q, v, a) -> (n,) generalised force that the cables must give for dv/dt = a: mass(q) a + bias(q, v)."""
        q, v, a = self._q, self._v, ca.MX.sym("a", self._rod.dof)
        lower, bias, *_ = self._chain.inertia(q, v, *self.free)
        force = ca.tril2symm(lower) @ a + bias + self._elastic_and_viscous(q, v)
        return self._function("inverse_dynamics", [q, v, a], [force], ["q", "v", "a"], ["force"])

    @cached_property
    def rhs(self) -> ca.Function:
        """(x, u) -> (2 n,) dx/dt."""
        mass, force, *_ = self.motion(self._x, self._u, *self.free)
        xdot = ca.vertcat(self._x[self._rod.dof :], self.solve(mass, force))
        return self._function("rhs", [self._x, self._u], [xdot], ["x", "u"], ["xdot"])

    @cached_property
    def loaded_rhs(self) -> ca.Function:
        """(x, u, tip) -> (2 n,) dx/dt under a tip load (12,): dead moment and force, follower moment and force."""
        x, u, tip = self._x, self._u, ca.MX.sym("tip", TIP_LOADS)
        mass, force, *_ = self.loaded_motion(x, u, tip, *self.free)
        xdot = ca.vertcat(x[self._rod.dof :], self.solve(mass, force))
        return self._function("loaded_rhs", [x, u, tip], [xdot], ["x", "u", "tip"], ["xdot"])

    @cached_property
    def forced_rhs(self) -> ca.Function:
        """(x, u, tip_force) -> (2 n,) dx/dt under a dead force (3,) N at the tip, world frame."""
        x, u, force = self._x, self._u, ca.MX.sym("tip_force", 3)
        xdot = self.loaded_rhs(x, u, dead_force(force), *self.free)
        return self._function("rhs", [x, u, force], [xdot], ["x", "u", "tip_force"], ["xdot"])

    @cached_property
    def energy(self) -> ca.Function:
        """x -> kinetic + elastic + gravitational energy, J; the last is zero at the world's origin."""
        q, v = self._x[: self._rod.dof], self._x[self._rod.dof :]
        kinetic = ca.bilin(self.mass(q, *self.free), v, v) / 2
        elastic = ca.bilin(ca.MX(self.stiffness), q, q) / 2
        energy = kinetic + elastic + self.statics(q, *self.free)[4]
        return self._function("energy", [self._x], [energy], ["x"], ["energy"])

    @cached_property
    def stiffness(self) -> ca.DM | ca.MX:
        """(n, n) constant: the integral of Phi' diag(GJ, EIy, EIz, EA, GA, GA) Phi; an expression of p if p is free."""
        return self._integral("stiffness_at")

    @cached_property
    def damping_matrix(self) -> ca.DM | ca.MX:
        """(n, n) constant: the integral of Phi' eta diag(Ix, 3 Iy, 3 Iz, 3 A, A, A) Phi; likewise."""
        return self._integral("damping_at")

    # What the other files of this room are built from.

    @property
    def free(self) -> tuple[ca.MX, ...]:
        """The last argument of every Function: (p,), or nothing where no parameter is free."""
        return self._parameters.free

    @cached_property
    def solve(self) -> ca.Function:
        """(lower triangle of a symmetric positive definite matrix, b) -> its inverse times b."""
        return _kernels.spd_solve_kernel(self._rod.dof)

    @property
    def statics(self) -> ca.Function:
        """q -> (tip rotation (3, 3), tip position (3,), tip body Jacobian (6, n), generalised force (n,) of gravity and
        constant loads, gravitational energy)."""
        return self._chain.statics

    @cached_property
    def motion(self) -> ca.Function:
        """(x, u) -> (mass, force, stiffness, damping): the lower triangle of the mass matrix, the generalised force
        that it accelerates with, and the lower triangles of what cables driven by length add to the stiffness and
        drag to the damping."""
        return self._motion(self._x, self._u, None)

    @cached_property
    def loaded_motion(self) -> ca.Function:
        """:attr:`motion` as (x, u, tip), under a tip load (12,)."""
        return self._motion(self._x, self._u, ca.MX.sym("tip", TIP_LOADS))

    def _motion(self, x: ca.MX, u: ca.MX, tip: ca.MX | None) -> ca.Function:
        n = self._rod.dof
        q, v = x[:n], x[n:]
        mass, bias, damping, R, J = self._chain.inertia(q, v, *self.free)
        actuation, lengths = self._actuation.columns(q, *self.free)
        tension, spring = self._actuation.tension(lengths, u)
        force = actuation @ tension - bias - self._elastic_and_viscous(q, v)
        stiffness = ca.MX(n, n)
        if self._actuation.by_length:
            stiffness = ca.tril(actuation @ ca.diag(spring) @ actuation.T)
        if tip is not None:
            force += self._chain.tip_load(q, R, J, tip, *self.free)
        inputs, names = ([x, u], ["x", "u"]) if tip is None else ([x, u, tip], ["x", "u", "tip"])
        outputs = ["mass", "force", "stiffness", "damping"]
        return self._function("motion", inputs, [mass, force, stiffness, damping], names, outputs)

    def _elastic_and_viscous(self, q: ca.MX, v: ca.MX) -> ca.MX:
        return self.stiffness @ q + self.damping_matrix @ v

    def _integral(self, sectional: str) -> ca.DM | ca.MX:
        blocks = [integral(division, getattr(division, sectional)) for division in self._rod.divisions]
        return self._parameters.lift(ca.sparsify(ca.diagcat(*blocks)))

    def _function(self, *definition: object) -> ca.Function:
        return self._parameters.function(*definition)  # type: ignore[arg-type]


def dead_force(force: ca.MX) -> ca.MX:
    """The tip load (12,) that is a dead force (3,)."""
    return ca.vertcat(ca.DM.zeros(3), force, ca.DM.zeros(6))
