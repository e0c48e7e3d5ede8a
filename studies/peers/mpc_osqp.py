"""OSQP's generated C: operator splitting, everything but the vectors fixed and factorised beforehand.

In its embedded mode rho does not adapt. Answers are not polished.
"""

import contextlib
import io
from pathlib import Path
from typing import Any

import numpy as np
from scipy import sparse

from .mpc_c import InC, build
from .mpc_case import Program


def osqp_c(folder: Path, program: Program, *, warm: bool) -> InC:
    """The C that `osqp.OSQP().codegen` writes."""
    import osqp  # pyright: ignore[reportMissingImports]

    H, A = with_slacks(program)
    gradient, ones = np.zeros(program.inputs + len(program.response)), np.ones(len(program.rows))
    solver = osqp.OSQP()
    solver.setup(program.cost * H, gradient, A, -ones, ones, **settings(program))
    with contextlib.redirect_stdout(io.StringIO()):
        solver.codegen(str(folder), parameters="vectors", force_rewrite=True)
    include = [folder / "inc" / "public", folder / "inc" / "private"]
    sources = ["mpc_osqp.c", folder / "workspace.c", *(folder / "src").glob("*.c")]
    return InC(folder, program, build(folder, program, sources, include=include), warm)


def settings(program: Program) -> dict[str, Any]:
    """Of OSQP wherever it is measured, from a scan of rho, alpha and how often convergence is tested."""
    fixed = {"adaptive_rho": False, "max_iter": 10_000, "verbose": False, "check_dualgap": False}
    fixed |= {"eps_abs": 1e-6, "eps_rel": 0.0, "check_termination": 10}
    return {"rho": 0.6, "alpha": 1.6 if program.soft else 1.5, **fixed}


def with_slacks(program: Program) -> tuple[sparse.csc_matrix, sparse.csc_matrix]:
    """Hessian and rows over (z, s) with one free slack for each output: -1 <= outputs + s <= 1."""
    n, slacks = program.inputs, len(program.response)
    H, A = sparse.csc_matrix(program.hessian), sparse.csc_matrix(program.rows)
    if slacks:
        free = sparse.vstack([sparse.csc_matrix((n, slacks)), sparse.eye(slacks)])
        H, A = sparse.block_diag([H, program.softening * sparse.eye(slacks)]), sparse.hstack([A, free])
    return sparse.csc_matrix(H), sparse.csc_matrix(A)


def slack_gradient(program: Program) -> np.ndarray:
    """What H of `with_slacks`, times the program's `cost`, has beside it: (inputs and slacks, parameters)."""
    nothing = np.zeros((len(program.response), program.p.shape[1]))
    return np.vstack([program.cost * program.gradient, nothing])
