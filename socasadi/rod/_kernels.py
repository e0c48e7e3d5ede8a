"""One quadrature step as a small CasADi SX Function, to be called in a loop from MX.

Written out for the whole rod at once, the equations of motion are one expression of tens of thousands of
instructions, on which a C compiler spends minutes. As one Function per step, called with that step's numbers,
the C holds the step once and compiles in seconds.

Between two nodes a distance h apart the pose follows exp(Gamma), with Gamma the fourth-order Magnus expansion on
the two Gauss points of the interval (Zannah collocation: Hairer, Lubich, Wanner, Geometric Numerical Integration,
IV.7; for rods Renda et al. 2020, arXiv 1912.11285):

    Gamma = h/2 (xi_a + xi_b) + sqrt(3) h^2/12 [xi_a, xi_b].

The body Jacobian J, the body velocity eta = J v and the acceleration without joint acceleration, c = (dJ/dt) v,
are carried along by differentiating that step.
"""

from math import sqrt

import casadi as ca

from . import _se3 as se3
from ._strain import Strain

GAUSS_POINTS = (0.5 - sqrt(3) / 6, 0.5 + sqrt(3) / 6)
"""Where in an interval the strain is evaluated, as fractions of its length."""


class _Step:
    """Expressions for one interval: its relative pose, and how its twist depends on the coordinates."""

    def __init__(self, strain: Strain, q: ca.SX, basis_a: ca.SX, basis_b: ca.SX, h: ca.SX) -> None:
        rest = ca.DM(strain.rest)
        xi_a, xi_b = rest + basis_a @ q, rest + basis_b @ q
        ad_a, ad_b = se3.adjoint_algebra(xi_a), se3.adjoint_algebra(xi_b)
        self.basis_a, self.basis_b = basis_a, basis_b
        self.bracket = sqrt(3) / 12 * h**2
        self.twist = h / 2 * (xi_a + xi_b) + self.bracket * (ad_a @ xi_b)
        self.jacobian = h / 2 * (basis_a + basis_b) + self.bracket * (ad_a @ basis_b - ad_b @ basis_a)
        self.coefficients = se3.coefficients(self.twist[:3])
        self.rotation, self.position = se3.exponential(self.twist, self.coefficients)

    def carry(self, twists: ca.SX) -> ca.SX:
        """Columns given in the frame at the start, seen from the frame at the end."""
        return se3.into_frame(self.rotation, self.position, twists)

    @property
    def tangent(self) -> ca.SX:
        return se3.tangent(self.twist, self.coefficients)


def _basis(name: str, strain: Strain) -> ca.SX:
    return ca.SX.sym(name, strain.sparsity)  # type: ignore[call-overload]


def pose_kernel(strain: Strain, length: float) -> ca.Function:
    """(R, p, q, s, h) -> (R, p): the pose at s + h from the pose at s."""
    R, p, q = ca.SX.sym("R", 3, 3), ca.SX.sym("p", 3), ca.SX.sym("q", strain.dof)
    s, h = ca.SX.sym("s"), ca.SX.sym("h")
    at = [ca.SX(strain.sparsity, ca.vertcat(*strain.nonzeros((s + c * h) / length))) for c in GAUSS_POINTS]
    step = _Step(strain, q, at[0], at[1], h)
    return ca.Function(
        "pose_kernel",
        [R, p, q, s, h],
        [R @ step.rotation, p + R @ step.position],
        ["R0", "p0", "q", "s", "h"],
        ["R", "p"],
    )


def static_kernel(strain: Strain) -> ca.Function:
    """(R, p, J, q, Phi_a, Phi_b, h) -> (R, p, J): pose and body Jacobian at the end of an interval."""
    n = strain.dof
    R, p, J = ca.SX.sym("R", 3, 3), ca.SX.sym("p", 3), ca.SX.sym("J", 6, n)
    q, h = ca.SX.sym("q", n), ca.SX.sym("h")
    basis_a, basis_b = _basis("basis_a", strain), _basis("basis_b", strain)
    step = _Step(strain, q, basis_a, basis_b, h)
    return ca.Function(
        "static_kernel",
        [R, p, J, q, basis_a, basis_b, h],
        [R @ step.rotation, p + R @ step.position, step.carry(J) + step.tangent @ step.jacobian],
        ["R0", "p0", "J0", "q", "basis_a", "basis_b", "h"],
        ["R", "p", "J"],
    )


def dynamic_kernel(strain: Strain) -> ca.Function:
    """Motion at a node from the node before, and what the slice around it adds to the equations of motion.

    (R, J, eta, c, q, v, Phi_a, Phi_b, h, inertia, gravity) -> (R, J, eta, c, mass, bias) with ``inertia`` (6,) the
    slice's mass matrix, its diagonal times the quadrature weight, ``gravity`` (3,) in the base frame, ``mass`` the
    lower triangle of J' inertia J, and ``bias`` (n,) the slice's inertial and gravitational part.
    """
    n = strain.dof
    R, J, eta, c = ca.SX.sym("R", 3, 3), ca.SX.sym("J", 6, n), ca.SX.sym("eta", 6), ca.SX.sym("c", 6)
    q, v, h = ca.SX.sym("q", n), ca.SX.sym("v", n), ca.SX.sym("h")
    basis_a, basis_b = _basis("basis_a", strain), _basis("basis_b", strain)
    inertia, gravity = ca.SX.sym("inertia", 6), ca.SX.sym("gravity", 3)
    step = _Step(strain, q, basis_a, basis_b, h)

    tangent = step.tangent
    rate = step.jacobian @ v
    added = tangent @ rate
    carried = step.carry(eta)
    # Second derivative of the interval's twist at zero joint acceleration: only the bracket is not linear in q.
    twist_acceleration = 2 * step.bracket * (se3.adjoint_algebra(basis_a @ v) @ (basis_b @ v))
    twist = ca.SX.sym("twist", 6)
    constant_rate = ca.SX.sym("rate", 6)
    tangent_rate = ca.jtimes(se3.tangent(twist) @ constant_rate, twist, constant_rate)
    tangent_rate = ca.substitute(
        tangent_rate, ca.vertcat(twist, constant_rate), ca.densify(ca.vertcat(step.twist, rate))
    )

    R1 = R @ step.rotation
    J1 = step.carry(J) + tangent @ step.jacobian
    eta1 = carried + added
    c1 = step.carry(c) - se3.adjoint_algebra(added) @ carried + tangent_rate + tangent @ twist_acceleration

    momentum = inertia * eta1
    wrench = inertia * c1 - se3.adjoint_algebra(eta1).T @ momentum
    wrench -= ca.vertcat(ca.SX(3, 1), inertia[3:] * (R1.T @ gravity))
    return ca.Function(
        "dynamic_kernel",
        [R, J, eta, c, q, v, basis_a, basis_b, h, inertia, gravity],
        [R1, J1, eta1, c1, ca.tril(J1.T @ (ca.repmat(inertia, 1, n) * J1)), J1.T @ wrench],
        ["R0", "J0", "eta0", "c0", "q", "v", "basis_a", "basis_b", "h", "inertia", "gravity"],
        ["R", "J", "eta", "c", "mass", "bias"],
        {"cse": True},
    )


def cable_kernel(strain: Strain, cables: int) -> ca.Function:
    """(q, Phi, offsets, slopes, weight) -> (actuation (n, cables), lengths (cables,)) of the slice around a node.

    A cable at offset d runs along t = linear strain + angular strain x d + d', of length |t| per unit of the rod's;
    its generalised force per newton is minus the derivative of that length with respect to q.
    """
    n = strain.dof
    q, basis, weight = ca.SX.sym("q", n), _basis("basis", strain), ca.SX.sym("weight")
    offsets, slopes = ca.SX.sym("offsets", 3, cables), ca.SX.sym("slopes", 3, cables)
    xi = ca.DM(strain.rest) + basis @ q
    columns, lengths = [], []
    for i in range(cables):
        along = xi[3:] + ca.cross(xi[:3], offsets[:, i]) + slopes[:, i]
        speed = ca.norm_2(along)
        direction = along / speed
        columns.append(-weight * (basis.T @ ca.vertcat(ca.cross(offsets[:, i], direction), direction)))
        lengths.append(weight * speed)
    return ca.Function(
        "cable_kernel",
        [q, basis, offsets, slopes, weight],
        [ca.densify(ca.horzcat(ca.SX(n, 0), *columns)), ca.vertcat(ca.SX(0, 1), *lengths)],
        ["q", "basis", "offsets", "slopes", "weight"],
        ["actuation", "lengths"],
    )


def spd_solve_kernel(n: int) -> ca.Function:
    """(lower triangle of A, b) -> A^-1 b for a symmetric positive definite A (n, n), by A = L D L'."""
    lower = ca.SX.sym("A", ca.Sparsity.lower(n))  # type: ignore[call-overload]
    b = ca.SX.sym("b", n)
    L = [[lower[i, j] for j in range(i + 1)] for i in range(n)]
    inverse_pivot: list[ca.SX] = []
    x = [b[i] for i in range(n)]
    for i in range(n):
        scaled = [L[i][j] for j in range(i)]
        for j in range(i):
            for k in range(j):
                scaled[j] -= scaled[k] * L[j][k]
            L[i][j] = scaled[j] * inverse_pivot[j]
        pivot = L[i][i]
        for j in range(i):
            pivot -= scaled[j] * L[i][j]
            x[i] -= L[i][j] * x[j]
        inverse_pivot.append(1 / pivot)
    x = [value * factor for value, factor in zip(x, inverse_pivot, strict=True)]
    for i in reversed(range(n)):
        for k in range(i + 1, n):
            x[i] -= L[k][i] * x[k]
    return ca.Function("spd_solve", [lower, b], [ca.vertcat(*x)], ["A", "b"], ["x"])
