"""CVXPYgen: the problem as one writes it in CVXPY, as C around OSQP's.

CVXPY has no rows with two sides: there are twice as many as OSQP's own C has, and rho is another.
"""

import contextlib
import io
from pathlib import Path

from .mpc_c import InC, build
from .mpc_case import Program
from .mpc_osqp import settings


def cvxpygen_c(folder: Path, program: Program) -> InC:
    """The C that `cvxpygen.cpg.generate_code` writes."""
    import cvxpy as cp  # pyright: ignore[reportMissingImports]
    from cvxpygen import cpg  # pyright: ignore[reportMissingImports]

    n, cost = program.inputs, program.cost
    p, z = cp.Parameter(program.p.shape[1], name="p"), cp.Variable(n, name="z")
    objective = cp.quad_form(z, cp.psd_wrap(cost * program.hessian)) / 2 + p @ (cost * program.gradient.T @ z)
    bounds = [z <= 1, z >= -1]
    if program.soft:
        s = cp.Variable(len(program.response), name="s")
        outputs = program.response @ z + program.free @ p + s
        objective += cost * program.softening * cp.sum_squares(s) / 2
        bounds += [outputs <= 1, outputs >= -1]
    problem = cp.Problem(cp.Minimize(objective), bounds)
    chosen = settings(program) | {"rho": 0.2, "alpha": 1.6}
    with contextlib.redirect_stdout(io.StringIO()):
        cpg.generate_code(problem, code_dir=str(folder), solver="OSQP", wrapper=False, solver_opts=chosen)
    code = folder / "c" / "solver_code"
    include = [folder / "c" / "include", code, code / "inc" / "public", code / "inc" / "private"]
    names = ("cpg_solve", "cpg_workspace")
    own = [folder / "c" / "src" / f"{name}.c" for name in names]
    sources = ["mpc_cvxpygen.c", *own, code / "workspace.c", *(code / "src").glob("*.c")]
    return InC(folder, program, build(folder, program, sources, include=include), warm=True)
