"""CasADi's `conic` plugins: as the C that it generates (daqp, osqp), and interpreted (qpoases).

The generated C sets its solver up anew at every call. OSQP has the rho of its own generated C. The quadratic
program is dense, over inputs and slacks.
"""

import ctypes
import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np

from .mpc_c import InC, build
from .mpc_case import Program
from .mpc_osqp import settings, with_slacks

PACKAGE = Path(str(ca.__file__)).parent
QPOASES = {
    "printLevel": "none",
    "sparse": False,
    "hessian_type": "posdef",
    "enableRamping": False,
    "enableFarBounds": False,
    "enableFlippingBounds": False,
    "enableRegularisation": False,
    "enableNZCTests": False,
    "enableFullLITests": False,
    "enableDriftCorrection": 0,
    "numRefinementSteps": 0,
}


def options(program: Program, plugin: str) -> dict[str, Any]:
    """Of the plugin: OSQP's, which is an older one, are those of its own generated C."""
    osqp = {name: value for name, value in settings(program).items() if name != "check_dualgap"}
    return {"osqp": {"osqp": osqp}, "qpoases": QPOASES}.get(plugin, {})


def casadi_c(folder: Path, program: Program, *, plugin: str) -> InC:
    """The function p -> z as CasADi's C, against the solver's static library in CasADi's wheel."""
    folder.mkdir(parents=True, exist_ok=True)
    code = ca.CodeGenerator("solution", {"with_header": True})
    code.add(solution(program, plugin))
    code.generate(f"{folder}/")
    names = {"daqp": "libdaqpstat.a", "osqp": "libosqpstatic.a"}
    # The generated code compares with daqp's EXIT_OPTIMAL, but does not include the header that has it.
    define = ["EXIT_OPTIMAL=1"] if plugin == "daqp" else []
    include = [PACKAGE / "include", PACKAGE / "include" / "osqp"]
    sources = ["mpc_casadi.c", folder / "solution.c"]
    executable = build(folder, program, sources, include=include, link=[PACKAGE / names[plugin]], define=define)
    return InC(folder, program, executable, warm=True)


def casadi_interpreted(program: Program, *, plugin: str) -> Callable[[np.ndarray], np.ndarray]:
    """The function p -> z, called on fixed buffers."""
    p, z = np.zeros(program.p.shape[1]), np.zeros(program.inputs)
    with silent():
        buffer, evaluate = solution(program, plugin).buffer()
        buffer.set_arg(0, p.data)  # pyright: ignore[reportCallIssue]
        buffer.set_res(0, z.data)  # pyright: ignore[reportCallIssue]
        evaluate()

    def solve(now: np.ndarray, keep: object = buffer) -> np.ndarray:
        p[:] = now
        evaluate()
        return z.copy()

    return solve


@contextmanager
def silent() -> Iterator[None]:
    """Nothing is printed, not by C either: qpOASES has a banner."""
    sys.stdout.flush()
    kept = os.dup(1)
    with open(os.devnull, "w") as nowhere:
        os.dup2(nowhere.fileno(), 1)
    try:
        yield
    finally:
        ctypes.CDLL(None).fflush(None)
        os.dup2(kept, 1)
        os.close(kept)


def solution(program: Program, plugin: str) -> ca.Function:
    """The answer z as a function of p."""
    n, slacks = program.inputs, len(program.response)
    H, A = with_slacks(program)
    p = ca.MX.sym("p", program.p.shape[1])
    H, rows = ca.DM(program.cost * H), ca.DM(A[n:])
    gradient = ca.vertcat(ca.DM(program.cost * program.gradient) @ p, ca.DM.zeros(slacks))
    solver = ca.conic("solver", plugin, {"h": H.sparsity(), "a": rows.sparsity()}, options(program, plugin))
    bound = np.concatenate([np.ones(n), np.full(slacks, np.inf)])
    free = ca.DM(program.free) @ p if slacks else ca.MX(0, 1)
    answer = solver(h=H, g=gradient, a=rows, lba=-1 - free, uba=1 - free, lbx=-bound, ubx=bound)
    return ca.Function("solution", [p], [answer["x"][:n]], ["p"], ["z"])
