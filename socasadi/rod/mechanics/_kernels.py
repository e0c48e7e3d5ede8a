"""One step along the rod as a small CasADi SX Function, to be called in a loop from MX.

Written out for the whole rod at once, the equations of motion are one expression of tens of thousands of
instructions, on which a C compiler spends minutes. As one Function per step, called with that step's numbers,
the C holds the step once and compiles in seconds.

Between two nodes a distance h apart the pose follows exp(Gamma), with Gamma the fourth-order Magnus expansion on
the two Gauss points of the interval (Zannah collocation: Hairer, Lubich, Wanner, Geometric Numerical Integration,
IV.7; for rods Renda et al. 2020, arXiv 1912.11285):

    Gamma = h/2 (xi_a + xi_b) + sqrt(3) h^2/12 [xi_a, xi_b].

The body Jacobian J, the body velocity eta = J v and the acceleration without joint acceleration, c = (dJ/dt) v,
are carried along by differentiating that step. Wrenches and twists hold the angular part first.

A division's kernels know its own n coordinates q and, of J, the ``columns`` of the rod up to its end, of which its own
are the last n.
"""

from math import sqrt

import casadi as ca

from ..body import Strain
from . import _se3 as se3

GAUSS_POINTS = (0.5 - sqrt(3) / 6, 0.5 + sqrt(3) / 6)
"""Where in an interval the strain is evaluated, as fractions of its length."""

_STILL = 1e-30  # (m/s)^2: keeps the norm of a velocity differentiable at rest
_STRAIGHT = 1e-12  # (rad/m)^2: likewise for the curvature of a cable


class _Step:
    """Expressions for one interval: its relative pose, and how its twist depends on the coordinates."""

    def __init__(self, q: ca.SX, bases: tuple[ca.SX, ca.SX], rests: tuple[ca.SX, ca.SX], h: ca.SX) -> None:
        basis_a, basis_b = bases
        xi_a, xi_b = rests[0] + basis_a @ q, rests[1] + basis_b @ q
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

    def carry_jacobian(self, J: ca.SX) -> ca.SX:
        """The body Jacobian at the end from that at the start, whose last columns are this division's own."""
        carried, own = self.carry(J), self.tangent @ self.jacobian
        others = J.shape[1] - own.shape[1]
        return ca.horzcat(carried[:, :others], carried[:, others:] + own)

    @property
    def tangent(self) -> ca.SX:
        return se3.tangent(self.twist, self.coefficients)


def pose_kernel(strain: Strain, length: float, parameters: ca.SX) -> ca.Function:
    """(R, p, q, x, h, parameters) -> (R, p): the pose h m beyond a place x = s / ``length`` from the pose there."""
    R, p, q = ca.SX.sym("R", 3, 3), ca.SX.sym("p", 3), ca.SX.sym("q", strain.dof)
    x, h = ca.SX.sym("x"), ca.SX.sym("h")
    at_a, at_b = (x + c * h / length for c in GAUSS_POINTS)
    bases = tuple(ca.SX(strain.sparsity, strain.values(at)) for at in (at_a, at_b))
    rests = (strain.rest_at(at_a), strain.rest_at(at_b))
    step = _Step(q, bases, rests, h)  # type: ignore[arg-type]
    return ca.Function(
        "pose_kernel",
        [R, p, q, x, h, parameters],
        [R @ step.rotation, p + R @ step.position],
        ["R0", "p0", "q", "x", "h", "parameters"],
        ["R", "p"],
    )


def static_kernel(strain: Strain, columns: int) -> ca.Function:
    """(R, p, J, q, Phi_a, Phi_b, rest_a, rest_b, h) -> (R, p, J): pose and body Jacobian at an interval's end."""
    R, p, J = ca.SX.sym("R", 3, 3), ca.SX.sym("p", 3), ca.SX.sym("J", 6, columns)
    q, numbers, step = _interval(strain)
    return ca.Function(
        "static_kernel",
        [R, p, J, q, *numbers],
        [R @ step.rotation, p + R @ step.position, step.carry_jacobian(J)],
        ["R0", "p0", "J0", "q", *_INTERVAL],
        ["R", "p", "J"],
    )


def motion_kernel(strain: Strain, columns: int) -> ca.Function:
    """(R, J, eta, c, q, v, Phi_a, Phi_b, rest_a, rest_b, h) -> (R, J, eta, c): the motion at an interval's end."""
    n = strain.dof
    R, J, eta, c = _moving(columns)
    v = ca.SX.sym("v", n)
    q, numbers, step = _interval(strain)

    tangent = step.tangent
    rate = step.jacobian @ v
    added = tangent @ rate
    carried = step.carry(eta)
    # Second derivative of the interval's twist at zero joint acceleration: only the bracket is not linear in q.
    twist_acceleration = 2 * step.bracket * (se3.adjoint_algebra(step.basis_a @ v) @ (step.basis_b @ v))
    twist = ca.SX.sym("twist", 6)
    constant_rate = ca.SX.sym("rate", 6)
    tangent_rate = ca.jtimes(se3.tangent(twist) @ constant_rate, twist, constant_rate)
    tangent_rate = ca.substitute(
        tangent_rate, ca.vertcat(twist, constant_rate), ca.densify(ca.vertcat(step.twist, rate))
    )
    c1 = step.carry(c) - se3.adjoint_algebra(added) @ carried + tangent_rate + tangent @ twist_acceleration
    return ca.Function(
        "motion_kernel",
        [R, J, eta, c, q, v, *numbers],
        [R @ step.rotation, step.carry_jacobian(J), carried + added, c1],
        ["R0", "J0", "eta0", "c0", "q", "v", *_INTERVAL],
        ["R", "J", "eta", "c"],
        {"cse": True},
    )


def slice_kernel(columns: int, drag: bool) -> ca.Function:
    """(R, J, eta, c, inertia, dead, follower, drag) -> (mass, bias, damping): what the slice at a node adds.

    ``inertia`` (6,) is the slice's mass matrix, its diagonal times the quadrature weight; ``dead`` and ``follower``
    (6,) are its loads in the world frame and in its own; ``drag`` (6,), empty without drag, holds the coefficients
    times the weight. ``mass`` and ``damping`` are the lower triangles of J' inertia J and of J' drag J, ``bias``
    (columns,) is the slice's inertia less its loads.
    """
    R, J, eta, c = _moving(columns)
    inertia, dead, follower = ca.SX.sym("inertia", 6), ca.SX.sym("dead", 6), ca.SX.sym("follower", 6)
    fluid = ca.SX.sym("drag", 6 if drag else 0)
    wrench = inertia * c - se3.adjoint_algebra(eta).T @ (inertia * eta) - _body_wrench(R, dead, follower)
    damping = ca.SX(columns, columns)
    if drag:
        axial, normal = ca.sqrt(eta[3] ** 2 + _STILL), ca.sqrt(eta[4] ** 2 + eta[5] ** 2 + _STILL)
        along, across = fluid[0] + fluid[2] * axial, fluid[1] + fluid[3] * normal
        coefficients = ca.vertcat(fluid[4], fluid[5], fluid[5], along, across, across)
        wrench += coefficients * eta
        damping = ca.tril(J.T @ (ca.repmat(coefficients, 1, columns) * J))
    mass = ca.tril(J.T @ (ca.repmat(inertia, 1, columns) * J))
    return ca.Function(
        "slice_kernel",
        [R, J, eta, c, inertia, dead, follower, fluid],
        [mass, J.T @ wrench, damping],
        ["R", "J", "eta", "c", "inertia", "dead", "follower", "drag"],
        ["mass", "bias", "damping"],
        {"cse": True},
    )


def payload_kernel(columns: int) -> ca.Function:
    """(R, J, eta, c, mass, inertia (3, 3), offset, gravity) -> (mass, bias) of a rigid body fixed to a section."""
    R, J, eta, c = _moving(columns)
    m, inertia = ca.SX.sym("m", 1), ca.SX.sym("inertia", 3, 3)
    offset, gravity = ca.SX.sym("offset", 3), ca.SX.sym("gravity", 3)
    arm = se3.skew(offset)
    body = ca.blockcat([[inertia + m * arm.T @ arm, m * arm], [m * arm.T, m * ca.SX.eye(3)]])
    weight = R.T @ (m * gravity)
    wrench = body @ c - se3.adjoint_algebra(eta).T @ (body @ eta) - ca.vertcat(arm @ weight, weight)
    return ca.Function(
        "payload_kernel",
        [R, J, eta, c, m, inertia, offset, gravity],
        [ca.tril(J.T @ (body @ J)), J.T @ wrench],
        ["R", "J", "eta", "c", "m", "inertia", "offset", "gravity"],
        ["mass", "bias"],
        {"cse": True},
    )


def load_kernel(columns: int) -> ca.Function:
    """(R, J, dead, follower, offset) -> generalised force (columns,) of loads at ``offset`` (3,) in a section."""
    R, J = ca.SX.sym("R", 3, 3), ca.SX.sym("J", 6, columns)
    dead, follower, offset = ca.SX.sym("dead", 6), ca.SX.sym("follower", 6), ca.SX.sym("offset", 3)
    wrench = _body_wrench(R, dead, follower)
    wrench = ca.vertcat(wrench[:3] + ca.cross(offset, wrench[3:]), wrench[3:])
    return ca.Function(
        "load_kernel",
        [R, J, dead, follower, offset],
        [J.T @ wrench],
        ["R", "J", "dead", "follower", "offset"],
        ["force"],
    )


def cable_kernel(strain: Strain, cables: int) -> ca.Function:
    """(q, Phi, rest, offsets, slopes, weight, pulls) -> (actuation (n, cables), lengths (cables,)) of a slice.

    A cable at offset d runs along t = linear strain + angular strain x d + d', of length |t| per unit of the rod's;
    its generalised force per unit of input is minus the derivative of that length with respect to q, times its
    entry of ``pulls`` (cables,).
    """
    n = strain.dof
    q, basis, rest, xi = _local(strain)
    weight, pulls = ca.SX.sym("weight"), ca.SX.sym("pulls", cables)
    offsets, slopes = ca.SX.sym("offsets", 3, cables), ca.SX.sym("slopes", 3, cables)
    columns, lengths = [], []
    for i in range(cables):
        along = xi[3:] + ca.cross(xi[:3], offsets[:, i]) + slopes[:, i]
        speed = ca.norm_2(along)
        direction = along / speed
        moment = ca.cross(offsets[:, i], direction)
        columns.append(-weight * pulls[i] * (basis.T @ ca.vertcat(moment, direction)))
        lengths.append(weight * speed)
    return ca.Function(
        "cable_kernel",
        [q, basis, rest, offsets, slopes, weight, pulls],
        [ca.densify(ca.horzcat(ca.SX(n, 0), *columns)), ca.vertcat(ca.SX(0, 1), *lengths)],
        ["q", "basis", "rest", "offsets", "slopes", "weight", "pulls"],
        ["actuation", "lengths"],
    )


def turning_kernel(strain: Strain, cables: int) -> ca.Function:
    """(q, Phi, dPhi/ds, rest, drest/ds, offsets, slopes, curves) -> (cables,) rad/m that each cable's tangent turns.

    With the direction t/|t| of :func:`cable_kernel` in the section's axes, which turn with the angular strain omega,
    a cable turns by |d(t/|t|)/ds + omega x t/|t|| per unit of the rod's length.
    """
    q, basis, rest, xi = _local(strain)
    basis_rate, rest_rate = ca.SX.sym("basis_rate", strain.sparsity), ca.SX.sym("rest_rate", 6)  # type: ignore[call-overload]
    offsets, slopes, curves = (ca.SX.sym(name, 3, cables) for name in ("offsets", "slopes", "curves"))
    xi_rate = rest_rate + basis_rate @ q
    turning = []
    for i in range(cables):
        d, slope = offsets[:, i], slopes[:, i]
        along = xi[3:] + ca.cross(xi[:3], d) + slope
        rate = xi_rate[3:] + ca.cross(xi_rate[:3], d) + ca.cross(xi[:3], slope) + curves[:, i] + ca.cross(xi[:3], along)
        # Only what is perpendicular to the cable turns it.
        turning.append(ca.sqrt(ca.sumsqr(ca.cross(along, rate)) / ca.sumsqr(along) ** 2 + _STRAIGHT))
    return ca.Function(
        "turning_kernel",
        [q, basis, basis_rate, rest, rest_rate, offsets, slopes, curves],
        [ca.vertcat(ca.SX(0, 1), *turning)],
        ["q", "basis", "basis_rate", "rest", "rest_rate", "offsets", "slopes", "curves"],
        ["turning"],
    )


def spd_solve_kernel(n: int) -> ca.Function:
    """(lower triangle of A, b) -> A^-1 b for a symmetric positive definite A (n, n), by A = L D L'."""
    lower, b = ca.SX.sym("A", ca.Sparsity.lower(n)), ca.SX.sym("b", n)  # type: ignore[call-overload]
    diagonal, unit, order = ca.ldl(ca.tril2symm(lower), False)
    return ca.Function("spd_solve", [lower, b], [ca.ldl_solve(b, diagonal, unit, order)], ["A", "b"], ["x"])


_INTERVAL = ("basis_a", "basis_b", "rest_a", "rest_b", "h")


def _interval(strain: Strain) -> tuple[ca.SX, list[ca.SX], _Step]:
    """The coordinates, the numbers of an interval as a kernel takes them, and its step."""
    q, h = ca.SX.sym("q", strain.dof), ca.SX.sym("h")
    basis_a, basis_b = _basis("basis_a", strain), _basis("basis_b", strain)
    (given_a, rest_a), (given_b, rest_b) = _rest("rest_a", strain), _rest("rest_b", strain)
    step = _Step(q, (basis_a, basis_b), (rest_a, rest_b), h)
    return q, [basis_a, basis_b, given_a, given_b, h], step


def _local(strain: Strain) -> tuple[ca.SX, ca.SX, ca.SX, ca.SX]:
    """(q, Phi, rest as a kernel takes it, the strain that they make)."""
    q, basis = ca.SX.sym("q", strain.dof), _basis("basis", strain)
    given, rest = _rest("rest", strain)
    return q, basis, given, rest + basis @ q


def _moving(columns: int) -> tuple[ca.SX, ca.SX, ca.SX, ca.SX]:
    return ca.SX.sym("R", 3, 3), ca.SX.sym("J", 6, columns), ca.SX.sym("eta", 6), ca.SX.sym("c", 6)


def _basis(name: str, strain: Strain) -> ca.SX:
    return ca.SX.sym(name, strain.sparsity)  # type: ignore[call-overload]


def _rest(name: str, strain: Strain) -> tuple[ca.SX, ca.SX]:
    """The rest strain as a kernel's argument, and as its expression: numbers that never change are not passed."""
    if strain.constant_rest is not None:
        return ca.SX.sym(name, 0), ca.SX(ca.DM(strain.constant_rest))
    rest = ca.SX.sym(name, 6)
    return rest, rest


def _body_wrench(R: ca.SX, dead: ca.SX, follower: ca.SX) -> ca.SX:
    return ca.vertcat(R.T @ dead[:3], R.T @ dead[3:]) + follower
