"""The QP solvers by name, one behaviour, and the test that each of their answers has to pass."""

import contextlib
import os
from collections.abc import Iterator

import casadi as ca

KKT_TOLERANCE = 1e-6
"""Largest KKT residual (see :func:`kkt_residual`) of an answer that is believed."""

_OPTIONS: dict[str, dict] = {
    "daqp": {},
    "qpoases": {"printLevel": "none"},
    "osqp": {
        "warm_start_primal": False,
        "warm_start_dual": False,
        "osqp": {
            "verbose": False,
            "eps_abs": 1e-8,
            "eps_rel": 1e-8,
            "max_iter": 20_000,
            "adaptive_rho_interval": 50,
        },
    },
}

BACKENDS = tuple(_OPTIONS)
"""Names of the QP solvers, the quickest that is right first."""


def check_backend(name: str) -> None:
    """ValueError when no QP solver goes by that name."""
    if name not in _OPTIONS:
        raise ValueError(f"unknown QP back end {name!r}; there are {', '.join(BACKENDS)}")


def qp_solver(name: str, variables: int, rows: int) -> ca.Function:
    """CasADi conic Function of a dense QP, min v'Hv/2 + g'v with bounds on v and on A v."""
    check_backend(name)
    pattern = {"h": ca.Sparsity.dense(variables, variables), "a": ca.Sparsity.dense(rows, variables)}
    with quiet(name == "qpoases"):
        return ca.conic("qp", name, pattern, {**_OPTIONS[name], "error_on_fail": False})


def kkt_residual(
    H: ca.MX,
    g: ca.MX,
    A: ca.MX,
    upper_rows: ca.MX,
    lower: ca.DM,
    upper: ca.DM,
    v: ca.MX,
    multipliers: ca.MX,
    row_multipliers: ca.MX,
) -> ca.MX:
    """Largest violation of the optimality conditions of min v'Hv/2 + g'v, lower <= v <= upper, A v <= upper_rows.

    Stationarity (relative to 1 + max |g|), feasibility, signs of the multipliers and complementarity; infinite when
    the answer is not finite. Multipliers are positive at an upper bound, negative at a lower one; ``upper`` may hold
    infinities.
    """
    stationarity = H @ v + g + A.T @ row_multipliers + multipliers
    slack_rows = upper_rows - A @ v
    at_upper, at_lower = ca.fmax(multipliers, 0), ca.fmax(-multipliers, 0)
    bounded = [i for i, value in enumerate(upper.full().ravel()) if value < float("inf")]
    open_above = [i for i in range(v.shape[0]) if i not in bounded]
    parts = [
        ca.fabs(stationarity) / (1 + ca.norm_inf(g)),
        -slack_rows,
        -row_multipliers,
        ca.fabs(row_multipliers * slack_rows),
        lower - v,
        at_lower * (v - lower),
        (v - upper)[bounded],
        (at_upper * (upper - v))[bounded],
        at_upper[open_above],
    ]
    everything = ca.vertcat(*parts)
    # mmax, by comparisons, would drop a NaN.
    return ca.if_else(finite(everything), ca.mmax(everything), ca.inf)


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
