"""Solvers by their Python packages: DAQP, PIQP, OSQP, Clarabel. Set up once; per problem the vectors are updated.

Gradients and bounds are formed by NumPy, within the time. Only OSQP and DAQP can start from the problem before.
"""

import time
from collections.abc import Callable

import numpy as np
from scipy import sparse

from .mpc_case import Program
from .mpc_osqp import settings, slack_gradient, with_slacks

Solve = Callable[[np.ndarray], np.ndarray]


class InPython:
    """A solver that is a Python function p -> z."""

    def __init__(self, program: Program, solve: Solve) -> None:
        self.problems, self.solve = program.p, solve

    def round(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Seconds (count,), iterations (count,; not known: 0) and answers (count, inputs x horizon) of one round."""
        seconds, answers = np.zeros(len(self.problems)), []
        for p in self.problems[:10]:  # memory and clock are at speed then, whoever had the turn before
            self.solve(p)
        for i, p in enumerate(self.problems):
            begin = time.perf_counter()
            z = self.solve(p)
            seconds[i] = time.perf_counter() - begin
            answers.append(z)
        return seconds, np.zeros(len(answers)), np.array(answers)

    def close(self) -> None:
        """Nothing is left to end."""


def daqp_python(program: Program) -> Solve:
    """`daqp.Model`, with its own soft rows."""
    import daqp  # pyright: ignore[reportMissingImports]

    n, ones = program.inputs, np.ones(len(program.rows))
    gradient, row_free = program.gradient, program.row_free
    response = program.response
    sense = np.where(np.arange(len(ones)) < n, 0, 8).astype(np.int32)
    model = daqp.Model()
    model.settings = {"primal_tol": 1e-9}
    model.setup(program.hessian, np.zeros(n), np.ascontiguousarray(response), ones, -ones, sense)
    if program.soft:
        weights = np.full(len(ones), 1 / program.softening)
        model.soft_weights(rho_l=weights, rho_u=weights)

    def solve(p: np.ndarray) -> np.ndarray:
        free = row_free @ p
        model.update(f=gradient @ p, bupper=ones - free, blower=-ones - free)
        return np.array(model.solve()[0])

    return solve


def piqp_python(program: Program) -> Solve:
    """`piqp.DenseSolver`: inputs only, and with a slack for each output."""
    import piqp  # pyright: ignore[reportMissingImports]

    n = program.inputs
    H, A = (matrix.toarray() for matrix in with_slacks(program))
    slacks, rows = A.shape[1] - n, A[n:]
    gradient, row_free = np.vstack([program.gradient, np.zeros((slacks, program.p.shape[1]))]), program.row_free[n:]
    bound = np.concatenate([np.ones(n), np.full(slacks, np.inf)])
    solver = piqp.DenseSolver()
    solver.settings.eps_abs = solver.settings.eps_rel = 1e-10
    solver.settings.eps_duality_gap_abs = solver.settings.eps_duality_gap_rel = 1e-10
    sides = {"G": rows, "h_l": -np.ones(slacks), "h_u": np.ones(slacks)} if slacks else {}
    solver.setup(P=program.cost * H, c=np.zeros(n + slacks), **sides, x_l=-bound, x_u=bound)

    def solve(p: np.ndarray) -> np.ndarray:
        c = program.cost * (gradient @ p)
        if slacks:
            free = row_free @ p
            solver.update(c=c, h_l=-1 - free, h_u=1 - free)
        else:
            solver.update(c=c)
        solver.solve()
        return np.array(solver.result.x[:n])

    return solve


def osqp_python(program: Program) -> Solve:
    """`osqp.OSQP` with the settings of its generated C."""
    import osqp  # pyright: ignore[reportMissingImports]

    n = program.inputs
    H, A = with_slacks(program)
    gradient, row_free = slack_gradient(program), program.row_free
    ones = np.ones(len(row_free))
    solver = osqp.OSQP()
    solver.setup(program.cost * H, np.zeros(len(gradient)), A, -ones, ones, **settings(program))

    def solve(p: np.ndarray) -> np.ndarray:
        free = row_free @ p
        solver.update(q=gradient @ p, l=-1 - free, u=1 - free)
        return solver.solve().x[:n]

    return solve


def clarabel_python(program: Program) -> Solve:
    """`clarabel.DefaultSolver`, updated; both sides of every row are rows of their own."""
    import clarabel  # pyright: ignore[reportMissingImports]

    n = program.inputs
    H, A = with_slacks(program)
    gradient, row_free = slack_gradient(program), program.row_free
    chosen = clarabel.DefaultSettings()
    chosen.verbose = chosen.presolve_enable = chosen.chordal_decomposition_enable = False
    chosen.max_threads = 1
    chosen.tol_feas = chosen.tol_gap_abs = chosen.tol_gap_rel = 1e-10
    sides = sparse.csc_matrix(sparse.vstack([A, -A]))
    cone = [clarabel.NonnegativeConeT(2 * len(row_free))]
    upper = sparse.csc_matrix(sparse.triu(program.cost * H))
    solver = clarabel.DefaultSolver(upper, np.zeros(len(gradient)), sides, np.ones(2 * len(row_free)), cone, chosen)

    def solve(p: np.ndarray) -> np.ndarray:
        free = row_free @ p
        solver.update(q=gradient @ p, b=np.concatenate([1 - free, 1 + free]))
        return np.array(solver.solve().x[:n])

    return solve
