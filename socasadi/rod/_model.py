from __future__ import annotations

from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING

import casadi as ca
import numpy as np

from ._kernels import (
    GAUSS_POINTS,
    cable_kernel,
    dynamic_kernel,
    pose_kernel,
    spd_solve_kernel,
    static_kernel,
)
from ._strain import gauss_legendre

if TYPE_CHECKING:
    from ._rod import Rod


class RodModel:
    """The equations of a rod as CasADi Functions, built when first asked for.

    With q the strain coordinates (n,), v their rates, x = [q; v] the state and u the cable tensions in newtons,

        mass(q) dv/dt + bias(q, v) = actuation(q) u.

    All Functions take numbers or CasADi symbols. Their C is small: call :func:`socasadi.codegen.compiled` on any.
    """

    def __init__(self, rod: Rod) -> None:
        self._rod = rod
        self._strain = rod.strain
        self._n = rod.strain.dof
        self._nodes, self._weights = gauss_legendre(rod.quadrature_points)

    @cached_property
    def pose(self) -> ca.Function:
        """(q, s) -> (4, 4) homogeneous pose of the section at arc length s, m, clipped to [0, L]."""
        q, s = ca.MX.sym("q", self._n), ca.MX.sym("s")
        kernel = pose_kernel(self._strain, self._rod.length)
        R, p = ca.MX(ca.DM.eye(3)), ca.MX(ca.DM.zeros(3))
        for start, h in self._intervals:
            R, p = kernel(R, p, q, start, ca.fmin(ca.fmax(s - start, 0), h))
        return ca.Function("pose", [q, s], [_homogeneous(R, p)], ["q", "s"], ["pose"])

    @cached_property
    def tip(self) -> ca.Function:
        """q -> (3,) position of the tip, m, base frame."""
        q = ca.MX.sym("q", self._n)
        return ca.Function("tip", [q], [self.statics(q)[1]], ["q"], ["tip"])

    @cached_property
    def mass(self) -> ca.Function:
        """q -> (n, n) mass matrix, symmetric positive definite, dense."""
        q = ca.MX.sym("q", self._n)
        lower = self.inertia(q, ca.DM.zeros(self._n))[0]
        return ca.Function("mass", [q], [ca.densify(ca.tril2symm(lower))], ["q"], ["mass"])

    @cached_property
    def bias(self) -> ca.Function:
        """(q, v) -> (n,) generalised force of inertia, gravity, elasticity and damping."""
        q, v = ca.MX.sym("q", self._n), ca.MX.sym("v", self._n)
        bias = self.inertia(q, v)[1] + self.stiffness @ q + self.damping_matrix @ v
        return ca.Function("bias", [q, v], [bias], ["q", "v"], ["bias"])

    @cached_property
    def actuation(self) -> ca.Function:
        """q -> (n, cables) generalised force per newton of tension: minus the derivative of the cable lengths."""
        q = ca.MX.sym("q", self._n)
        return ca.Function("actuation", [q], [self._cables(q)[0]], ["q"], ["actuation"])

    @cached_property
    def cable_lengths(self) -> ca.Function:
        """q -> (cables,) lengths, m."""
        q = ca.MX.sym("q", self._n)
        return ca.Function("cable_lengths", [q], [self._cables(q)[1]], ["q"], ["lengths"])

    @cached_property
    def rhs(self) -> ca.Function:
        """(x, u) -> (2 n,) dx/dt."""
        x, u = ca.MX.sym("x", 2 * self._n), ca.MX.sym("u", len(self._rod.cables))
        return ca.Function("rhs", [x, u], [self.forced_rhs(x, u, ca.DM.zeros(3))], ["x", "u"], ["xdot"])

    @cached_property
    def forced_rhs(self) -> ca.Function:
        """(x, u, tip_force) -> (2 n,) dx/dt under a dead force (3,) N at the tip, base frame."""
        x, u = ca.MX.sym("x", 2 * self._n), ca.MX.sym("u", len(self._rod.cables))
        tip_force = ca.MX.sym("tip_force", 3)
        lower, force = self.motion(x, u, tip_force)
        xdot = ca.vertcat(x[self._n :], self.solve(lower, force))
        return ca.Function("rhs", [x, u, tip_force], [xdot], ["x", "u", "tip_force"], ["xdot"])

    @cached_property
    def energy(self) -> ca.Function:
        """x -> kinetic + elastic + gravitational energy, J; gravitational zero is at the base."""
        x = ca.MX.sym("x", 2 * self._n)
        q, v = x[: self._n], x[self._n :]
        kinetic = ca.bilin(self.mass(q), v, v) / 2
        elastic = ca.bilin(ca.MX(self.stiffness), q, q) / 2
        return ca.Function("energy", [x], [kinetic + elastic + self.statics(q)[4]], ["x"], ["energy"])

    @cached_property
    def stiffness(self) -> ca.DM:
        """(n, n) constant: the integral of Phi' diag(GJ, EIy, EIz, EA, GA, GA) Phi."""
        material, section = self._rod.material, self._rod.section
        E, G = material.young, material.shear_modulus
        J = section.torsion_constant or section.Ix
        diagonal = [G * J, E * section.Iy, E * section.Iz, E * section.area, G * section.area, G * section.area]
        return self._gram(diagonal)

    @cached_property
    def damping_matrix(self) -> ca.DM:
        """(n, n) constant: the integral of Phi' eta diag(Ix, 3 Iy, 3 Iz, 3 A, A, A) Phi."""
        eta, section = self._rod.material.damping, self._rod.section
        A = section.area
        return self._gram([eta * k for k in (section.Ix, 3 * section.Iy, 3 * section.Iz, 3 * A, A, A)])

    # What the other files of this room are built from.

    @cached_property
    def solve(self) -> ca.Function:
        """(lower triangle of a symmetric positive definite matrix, b) -> its inverse times b."""
        return spd_solve_kernel(self._n)

    @cached_property
    def statics(self) -> ca.Function:
        """q -> (tip rotation (3, 3), tip position (3,), tip body Jacobian (6, n), gravity's generalised force (n,),
        gravitational energy)."""
        q = ca.MX.sym("q", self._n)
        kernel = static_kernel(self._strain)
        gravity = ca.DM(self._rod.gravity)
        R, p, J = ca.MX(ca.DM.eye(3)), ca.MX(ca.DM.zeros(3)), ca.MX(ca.DM.zeros(6, self._n))
        force, potential = ca.MX(ca.DM.zeros(self._n)), ca.MX(0)
        masses = [*(self._section_mass[3] * self._rod.length * self._weights), 0.0]
        for mass, (start, h) in zip(masses, self._intervals, strict=True):
            R, p, J = kernel(R, p, J, q, *self._bases(start, h), h)
            if mass and any(self._rod.gravity):
                force += mass * (J[3:, :].T @ (R.T @ gravity))
                potential -= mass * ca.dot(gravity, p)
        return ca.Function(
            "statics",
            [q],
            [R, p, J, force, potential],
            ["q"],
            ["rotation", "position", "jacobian", "gravity", "potential"],
        )

    @cached_property
    def motion(self) -> ca.Function:
        """(x, u, tip_force) -> (lower triangle of the mass matrix, generalised force without inertia's first part)."""
        n = self._n
        x, u = ca.MX.sym("x", 2 * n), ca.MX.sym("u", len(self._rod.cables))
        tip_force = ca.MX.sym("tip_force", 3)
        q, v = x[:n], x[n:]
        lower, bias, R, J = self.inertia(q, v)
        (start, h) = self._intervals[-1]
        R, _, J = static_kernel(self._strain)(R, ca.DM.zeros(3), J, q, *self._bases(start, h), h)
        force = self._cables(q)[0] @ u + J[3:, :].T @ (R.T @ tip_force) - bias
        force -= self.stiffness @ q + self.damping_matrix @ v
        return ca.Function("motion", [x, u, tip_force], [lower, force])

    @cached_property
    def inertia(self) -> ca.Function:
        """(q, v) -> (lower triangle of the mass matrix, inertia and gravity (n,), R and J at the last node)."""
        n = self._n
        q, v = ca.MX.sym("q", n), ca.MX.sym("v", n)
        kernel = dynamic_kernel(self._strain)
        R, J, eta, c = (ca.MX(ca.DM(value)) for value in (np.eye(3), np.zeros((6, n)), np.zeros(6), np.zeros(6)))
        lower, bias = ca.MX(ca.DM.zeros(ca.Sparsity.lower(n))), ca.MX(ca.DM.zeros(n))
        for weight, (start, h) in zip(self._weights, self._intervals[:-1], strict=True):
            slice_mass = self._rod.length * weight * self._section_mass
            R, J, eta, c, mass_part, bias_part = kernel(
                R, J, eta, c, q, v, *self._bases(start, h), h, slice_mass, self._rod.gravity
            )
            lower, bias = lower + mass_part, bias + bias_part
        return ca.Function("inertia", [q, v], [lower, bias, R, J])

    @cached_property
    def _cables(self) -> ca.Function:
        q = ca.MX.sym("q", self._n)
        cables, length = self._rod.cables, self._rod.length
        kernel = cable_kernel(self._strain, len(cables))
        actuation, lengths = ca.MX(ca.DM.zeros(self._n, len(cables))), ca.MX(ca.DM.zeros(len(cables)))
        for x, weight in zip(self._nodes, self._weights, strict=True):
            paths = [cable.path(x * length) for cable in cables]
            offsets, slopes = (np.array([path[i] for path in paths]).reshape(-1, 3).T for i in (0, 1))
            parts = kernel(q, self._strain.basis(x), offsets, slopes, weight * length)
            actuation, lengths = actuation + parts[0], lengths + parts[1]
        return ca.Function("cables", [q], [actuation, lengths])

    @property
    def _intervals(self) -> list[tuple[float, float]]:
        """(start, length) of the steps from the base over the quadrature nodes to the tip, m."""
        stops = np.array([0.0, *self._nodes, 1.0]) * self._rod.length
        return [(float(a), float(b - a)) for a, b in pairwise(stops)]

    def _bases(self, start: float, h: float) -> tuple[ca.DM, ca.DM]:
        a, b = (self._strain.basis((start + c * h) / self._rod.length) for c in GAUSS_POINTS)
        return a, b

    def _gram(self, diagonal: list[float]) -> ca.DM:
        return ca.sparsify(ca.DM(self._rod.length * self._strain.gram(np.array(diagonal))))

    @cached_property
    def _section_mass(self) -> np.ndarray:
        section = self._rod.section
        moments = [section.Ix, section.Iy, section.Iz, section.area, section.area, section.area]
        return self._rod.material.density * np.array(moments)


def _homogeneous(R: ca.MX, p: ca.MX) -> ca.MX:
    return ca.blockcat([[R, p], [ca.DM.zeros(1, 3), ca.DM.ones(1)]])
