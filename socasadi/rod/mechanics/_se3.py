"""Rigid motions for CasADi SX: exponential, adjoints and the tangent operator, exact to rounding at every angle.

A twist is the 6-vector (angular, linear) in the body frame. A pose is the pair (R, p): rotation matrix (3, 3) and
position (3,). Everything is written with the entire functions

    c_k(x) = sum over j of (-x)^j / (2 j + k)!,     x = |omega|^2,

so that c_0 = cos|omega|, c_1 = sin|omega|/|omega|, and so on. They obey c_k = 1/k! - x c_{k+2}, which is stable
downwards: only c_4 and c_5 are evaluated, the others follow. No formula divides by an angle, and automatic
differentiation is right at zero too.
"""

from math import factorial, pi

import casadi as ca

_SERIES_TERMS = 10  # below x = 1 the first term left out is 1/24!, far under rounding


def skew(a: ca.SX) -> ca.SX:
    """Matrix (3, 3) with ``skew(a) @ b == cross(a, b)``."""
    zero = ca.SX(1, 1)
    return ca.vertcat(ca.horzcat(zero, -a[2], a[1]), ca.horzcat(a[2], zero, -a[0]), ca.horzcat(-a[1], a[0], zero))


def coefficients(omega: ca.SX) -> dict[int, ca.SX]:
    """The functions c_0 to c_5 of x = ``omega``' ``omega``, by number."""
    x = ca.sumsqr(omega)
    small = x < 1
    # Each branch must stay finite, with its derivatives, where the other one is taken: 0 * nan is nan.
    x_closed, x_series = ca.if_else(small, pi**2, x), ca.if_else(small, x, 0)
    angle = ca.sqrt(x_closed)
    closed = {4: (0.5 - (1 - ca.cos(angle)) / x_closed) / x_closed}
    closed[5] = (1 / 6 - (1 - ca.sin(angle) / angle) / x_closed) / x_closed
    c = {k: ca.if_else(small, _series(k, x_series), closed[k]) for k in (5, 4)}
    for k in (3, 2, 1, 0):
        c[k] = 1 / factorial(k) - x * c[k + 2]
    return c


def _series(k: int, x: ca.SX) -> ca.SX:
    value = ca.SX(0)
    for j in reversed(range(_SERIES_TERMS)):
        value = value * x + (-1) ** j / factorial(2 * j + k)
    return value


def exponential(twist: ca.SX, c: dict[int, ca.SX] | None = None) -> tuple[ca.SX, ca.SX]:
    """Pose (R, p) reached by following ``twist`` (6,) for unit length; ``c`` are its coefficients if known."""
    omega, rho = twist[:3], twist[3:]
    c = c or coefficients(omega)
    hat = skew(omega)
    square = hat @ hat
    rotation = ca.SX.eye(3) + c[1] * hat + c[2] * square
    return rotation, (ca.SX.eye(3) + c[2] * hat + c[3] * square) @ rho


def tangent(twist: ca.SX, c: dict[int, ca.SX] | None = None) -> ca.SX:
    """Matrix D (6, 6) with (exp^-1 d exp)^vee = D d(twist): the body-frame derivative of the exponential.

    The lower left block is the derivative of the rotational block along ``rho``, because se(3) is so(3) over the
    dual numbers; the derivatives of c_2 and c_3 follow from c_k' = -(c_{k+1} - k c_{k+2}) / 2.
    """
    omega, rho = twist[:3], twist[3:]
    c = c or coefficients(omega)
    w, r = skew(omega), skew(rho)
    square = w @ w
    rotational = ca.SX.eye(3) - c[2] * w + c[3] * square
    along = ca.dot(omega, rho)
    mixed = -c[2] * r + c[3] * (w @ r + r @ w) + along * ((c[3] - 2 * c[4]) * w - (c[4] - 3 * c[5]) * square)
    return ca.blockcat([[rotational, ca.SX(3, 3)], [mixed, rotational]])


def adjoint_algebra(twist: ca.SX) -> ca.SX:
    """Matrix ad (6, 6): ``adjoint_algebra(a) @ b`` is the Lie bracket of the twists a and b."""
    w, r = skew(twist[:3]), skew(twist[3:])
    return ca.blockcat([[w, ca.SX(3, 3)], [r, w]])


def into_frame(rotation: ca.SX, position: ca.SX, twists: ca.SX) -> ca.SX:
    """Ad of the inverse pose applied to the columns of ``twists`` (6, m): seen from the frame at (R, p)."""
    angular, linear = twists[:3, :], twists[3:, :]
    return ca.vertcat(rotation.T @ angular, rotation.T @ (linear - skew(position) @ angular))
