"""One quadratic program, any back end, one behaviour."""

from collections.abc import Callable
from functools import partial
from typing import Literal, NamedTuple

import numpy as np
from scipy.optimize import linprog

from ..formulation import dual_program
from ._active_set import ActiveSet
from ._qp import CONIC, KKT_TOLERANCE, QuadraticProgram, Shape, kkt_residual, qp_solver, quiet


class Answer(NamedTuple):
    """What a back end makes of a :class:`QuadraticProgram`."""

    z: np.ndarray
    """(n,) the minimiser; NaN unless ``status`` is "optimal"."""
    multipliers: np.ndarray
    """(k,) positive where an upper bound is active, negative at a lower one; NaN unless ``status`` is "optimal"."""
    residual: float
    """See :func:`kkt_residual`; of what the solver gave, believed or not."""
    status: Literal["optimal", "infeasible", "failed"]


def solve(problem: QuadraticProgram, backend: str = CONIC[0]) -> Answer:
    """The solution of ``problem`` by a back end.

    Whatever the solver says of itself, its answer is "optimal" when it meets the optimality conditions to
    ``KKT_TOLERANCE``, and is no answer otherwise: then the program is "infeasible" when its hard rows contradict each
    other, which a linear program decides, or the solver has "failed".

    Raises
    ------
    ValueError
        There is no such back end, or the program's parts do not fit each other or are not numbers.
    """
    problem = _checked(problem)
    if backend not in _SOLVERS:
        raise ValueError(f"unknown QP back end {backend!r}; there are {', '.join(_SOLVERS)}")
    z, multipliers = _SOLVERS[backend](problem)
    given = (problem.gradient, problem.lower, problem.upper, z, multipliers)
    residual = float(kkt_residual(shape(problem))(*given))
    if residual <= KKT_TOLERANCE:
        return Answer(z, multipliers, residual, "optimal")
    status = "infeasible" if _contradictory(problem) else "failed"
    return Answer(np.full_like(z, np.nan), np.full_like(multipliers, np.nan), residual, status)


def shape(problem: QuadraticProgram) -> Shape:
    """What of ``problem`` a solver is built for."""
    return Shape(problem.hessian, problem.rows, problem.quadratic, problem.price)


def _conic(name: str, problem: QuadraticProgram) -> tuple[np.ndarray, np.ndarray]:
    try:
        with quiet(name == "qpoases"):
            answers = qp_solver(name, shape(problem)).call([problem.gradient, problem.lower, problem.upper])
    except RuntimeError:
        return np.full(len(problem.hessian), np.nan), np.full(len(problem.rows), np.nan)
    z, multipliers = (answer.full().ravel() for answer in answers)
    return z, multipliers


def _active_set(problem: QuadraticProgram) -> tuple[np.ndarray, np.ndarray]:
    """It knows multipliers and rows only; z is the minimiser for these multipliers."""
    H, f, rows, *bounds = problem
    dual = dual_program(H, f[:, None], rows, np.zeros((len(rows), 1)), *bounds)
    multipliers = ActiveSet(dual).solve(np.ones(1)).multipliers
    return -np.linalg.solve(H, f + rows.T @ multipliers), multipliers


_SOLVERS: dict[str, Callable[[QuadraticProgram], tuple[np.ndarray, np.ndarray]]] = {
    "active-set": _active_set,
    **{name: partial(_conic, name) for name in CONIC},
}


def _contradictory(problem: QuadraticProgram) -> bool:
    """Whether no z meets all hard rows: the least common violation of rows of unit length is not zero."""
    hard = np.isinf(problem.quadratic)
    length = np.linalg.norm(problem.rows[hard], axis=1)
    length[length == 0] = 1.0
    rows, lower, upper = (of[hard] / (length[:, None] if of.ndim == 2 else length) for of in problem[2:5])
    sides = np.vstack([rows[np.isfinite(upper)], -rows[np.isfinite(lower)]])
    bounds = np.concatenate([upper[np.isfinite(upper)], -lower[np.isfinite(lower)]])
    if not len(sides):
        return False
    n = len(problem.hessian)
    least = linprog(
        np.r_[np.zeros(n), 1.0],
        A_ub=np.column_stack([sides, -np.ones(len(sides))]),
        b_ub=bounds,
        bounds=[(None, None)] * n + [(0, None)],
    )
    return bool(least.success and least.fun > KKT_TOLERANCE * (1 + np.abs(bounds).max()))


def _checked(problem: QuadraticProgram) -> QuadraticProgram:
    arrays = QuadraticProgram(*(np.asarray(part, dtype=float) for part in problem))
    n, k = len(arrays.hessian), len(arrays.rows)
    wanted = QuadraticProgram((n, n), (n,), (k, n), (k,), (k,), (k,), (k,))  # pyright: ignore[reportArgumentType]
    for name, array, size in zip(problem._fields, arrays, wanted, strict=True):
        if array.shape != size:
            raise ValueError(f"{name} has shape {array.shape}, but {size} fits {n} variables and {k} rows")
        if np.isnan(array).any():
            raise ValueError(f"{name} of the quadratic program holds NaN")
    if not (arrays.quadratic > 0).all() or not (arrays.price >= 0).all():
        raise ValueError("a soft row has a positive quadratic weight and a price that is not negative")
    return arrays
