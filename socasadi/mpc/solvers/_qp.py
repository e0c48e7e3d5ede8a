"""Quadratic programs: their data, CasADi's solvers for them by name, and the test that each answer has to pass."""

import contextlib
import os
from collections.abc import Iterator
from typing import NamedTuple

import casadi as ca
import numpy as np

from .._tables import KKT_TOLERANCES

KKT_TOLERANCE = KKT_TOLERANCES["double"]
"""Largest KKT residual (see :func:`kkt_residual`) of an answer that is believed."""

_OPTIONS: dict[str, dict] = {
    "daqp": {"daqp": {"primal_tol": 1e-9}},
    "qpoases": {"printLevel": "none"},
    "osqp": {
        "warm_start_primal": False,
        "warm_start_dual": False,
        "osqp": {
            "verbose": False,
            "eps_abs": 1e-11,
            "eps_rel": 1e-11,
            "max_iter": 20_000,
            "adaptive_rho_interval": 50,
        },
    },
}

CONIC = tuple(_OPTIONS)
"""Names of CasADi's QP solvers, the quickest that is right first."""

BACKENDS = ("active-set", *CONIC)
"""Names of all QP solvers: the project's own and CasADi's."""


def check_backend(name: str) -> None:
    """ValueError when no QP solver goes by that name."""
    if name not in BACKENDS:
        raise ValueError(f"unknown QP back end {name!r}; there are {', '.join(BACKENDS)}")


class QuadraticProgram(NamedTuple):
    r"""A strictly convex quadratic program with soft rows.

    .. math::
        \min_z\; z'Hz/2 + f'z + \sum_{soft} (c_i s_i + q_i s_i^2 / 2), \qquad
        l_i - s_i \le a_i z \le u_i + s_i,\; s_i \ge 0,

    with :math:`s_i = 0` for hard rows.
    """

    hessian: np.ndarray
    """(n, n) H, positive definite."""
    gradient: np.ndarray
    """(n,) f"""
    rows: np.ndarray
    """(k, n) a"""
    lower: np.ndarray
    """(k,) l, may be infinite."""
    upper: np.ndarray
    """(k,) u, may be infinite."""
    quadratic: np.ndarray
    """(k,) q; infinite: the row is hard."""
    price: np.ndarray
    """(k,) c, 0 for hard rows."""


class Shape(NamedTuple):
    """What of a :class:`QuadraticProgram` stays from sample to sample."""

    hessian: np.ndarray
    rows: np.ndarray
    quadratic: np.ndarray
    price: np.ndarray


def qp_solver(name: str, shape: Shape) -> ca.Function:
    """One of CasADi's solvers for programs of a shape: (f, l, u) -> (z, multipliers).

    A multiplier (k,) is positive where the upper bound of its row is active, negative at the lower one. Each soft row
    has its slack s as a variable beside z, and stands twice: a z - s <= u, a z + s >= l.
    """
    n, k = len(shape.hessian), len(shape.rows)
    (H, rows, quadratic, price), variable, unit = _scaled(shape)
    # Rows that are the variables themselves are bounds to a solver, which it takes more lightly.
    box = n if k >= n and np.array_equal(shape.rows[:n], np.eye(n)) and np.isinf(quadratic[:n]).all() else 0
    hard = [i for i in range(box, k) if np.isinf(quadratic[i])]
    soft = [i for i in range(k) if np.isfinite(quadratic[i])]
    slack, none = np.eye(len(soft)), np.full(len(soft), np.inf)
    zero = np.zeros((n, len(soft)))
    A = np.block([[rows[hard], np.zeros((len(hard), len(soft)))], [rows[soft], -slack], [rows[soft], slack]])
    weights = np.block([[H, zero], [zero.T, np.diag(quadratic[soft])]])
    free = np.full(n - box, np.inf)
    f, below, above = (ca.MX.sym(of, size) for of, size in (("f", n), ("lower", k), ("upper", k)))  # pyright: ignore
    lower, upper = below / unit, above / unit
    answer = _conic(name, len(weights), len(A))(
        h=ca.MX(ca.DM(weights)),
        g=ca.vertcat(f * variable, ca.DM(price[soft])),
        a=ca.MX(ca.DM(A)),
        lba=ca.vertcat(lower[hard], -none, lower[soft]),
        uba=ca.vertcat(upper[hard], upper[soft], none),
        lbx=ca.vertcat(lower[:box], -free, np.zeros(len(soft))),
        ubx=ca.vertcat(upper[:box], free, none),
    )
    at_hard, at_upper, at_lower = ca.vertsplit(
        answer["lam_a"], np.cumsum([0, len(hard), len(soft), len(soft)]).tolist()
    )
    order = np.argsort([*range(box), *hard, *soft]).tolist()
    multipliers = ca.vertcat(answer["lam_x"][:box], at_hard, at_upper + at_lower)[order]
    return ca.Function("qp", [f, below, above], [answer["x"][:n] * variable, multipliers / unit])


def _scaled(shape: Shape) -> tuple[Shape, np.ndarray, np.ndarray]:
    """The same program in variables of unit curvature and rows of unit length, and what 1 in each of them was."""
    H, rows, quadratic, price = shape
    variable = 1 / np.sqrt(np.diag(H))
    unit = np.linalg.norm(rows * variable, axis=1)
    unit[unit == 0] = 1.0
    scaled = Shape(
        hessian=H * np.outer(variable, variable),
        rows=rows * variable / unit[:, None],
        quadratic=quadratic * unit**2,
        price=price * unit,
    )
    return scaled, variable, unit


def _conic(name: str, variables: int, rows: int) -> ca.Function:
    """CasADi's plugin for a dense QP: min v'Hv/2 + g'v with bounds on v and on A v."""
    if name not in _OPTIONS:
        raise ValueError(f"CasADi has no QP solver {name!r} that is trusted here; there are {', '.join(CONIC)}")
    pattern = {"h": ca.Sparsity.dense(variables, variables), "a": ca.Sparsity.dense(rows, variables)}
    with quiet(name == "qpoases"):
        return ca.conic("qp", name, pattern, {**_OPTIONS[name], "error_on_fail": False})


def kkt_residual(shape: Shape) -> ca.Function:
    r"""Largest violation of the optimality conditions of programs of a shape: (f, l, u, z, multipliers) -> number.

    Every part is measured as a displacement, so that it says how far the answer may be off:

    - stationarity: z against the minimiser for these multipliers, :math:`-H^{-1}(f + a'\lambda)`, relative to
      :math:`1 + \max |z|`;
    - feasibility, signs and complementarity of each row i at once, in the row's own unit: its value v against
      :math:`prox_{t \varphi}(v + t \lambda_i)`, which it equals if and only if :math:`\lambda_i` is a subgradient of
      the cost :math:`\varphi` of exceeding its bounds (infinite, for a hard row). :math:`t = a_i H^{-1} a_i'` is what a
      unit of the multiplier moves the row by (Parikh and Boyd, "Proximal algorithms", 2014, section 2.3).

    Infinite when anything is not finite.
    """
    H, rows, quadratic, price = shape
    n, k = len(H), len(rows)
    names = {"f": n, "lower": k, "upper": k, "z": n, "multipliers": k}
    f, lower, upper, z, multipliers = (ca.MX.sym(name, size) for name, size in names.items())  # pyright: ignore
    inverse = np.linalg.inv(H)
    inverse = (inverse + inverse.T) / 2
    shift = np.einsum("ij,jk,ik->i", rows, inverse, rows)
    with np.errstate(divide="ignore", invalid="ignore"):
        # Share of what is beyond the price's reach that the slack takes. A hard row that no variable moves takes none.
        share = np.nan_to_num((1 / quadratic) / (1 / quadratic + shift))
    value = ca.DM(rows) @ z
    target = value + shift * multipliers

    def pulled(beyond: ca.MX) -> ca.MX:
        return ca.fmax(beyond, 0) - ca.fmax(beyond - shift * price, 0) * share

    prox = target - pulled(target - upper) + pulled(lower - target)
    stationary = -ca.DM(inverse) @ (f + ca.DM(rows.T) @ multipliers)
    parts = ca.vertcat(ca.fabs(z - stationary) / (1 + ca.norm_inf(z)), ca.fabs(value - prox))
    # mmax, by comparisons, would drop a NaN, and so do fmin and fmax.
    sound = finite(ca.vertcat(f, z, multipliers, value, stationary, parts))
    residual = ca.if_else(sound, ca.mmax(parts), ca.inf)
    return ca.Function("kkt_residual", [f, lower, upper, z, multipliers], [residual])


def finite(values: ca.MX) -> ca.MX:
    """1 when every entry is finite, else 0. (CasADi takes x - x for zero, so that it cannot serve as the test.)"""
    return below(values, ca.inf)


def below(values: ca.MX, limit: float) -> ca.MX:
    """1 when every entry is a number of magnitude less than ``limit``, else 0."""
    return ca.mmin(ca.fabs(values) < limit)


@contextlib.contextmanager
def quiet(active: bool) -> Iterator[None]:
    """Nothing reaches ``sys.stdout``, through which CasADi prints: qpOASES shows its licence at any print level."""
    if not active:
        yield
        return
    with open(os.devnull, "w") as nowhere, contextlib.redirect_stdout(nowhere):
        yield
