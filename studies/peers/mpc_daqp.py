"""DAQP's method in C with everything set up beforehand: the library and the headers in CasADi's wheel."""

from pathlib import Path

import casadi as ca

from .mpc_c import InC, build
from .mpc_case import Program

PACKAGE = Path(str(ca.__file__)).parent


def daqp_c(folder: Path, program: Program, *, warm: bool) -> InC:
    """`daqp_ldp` for given bounds of the minimum-distance form; warm: from the last working set and factors."""
    link = [PACKAGE / "libdaqpstat.a"]
    executable = build(folder, program, ["mpc_daqp.c"], include=[PACKAGE / "include"], link=link)
    return InC(folder, program, executable, warm)


def daqp_bytes(program: Program) -> tuple[int, int]:
    """Tables and working memory, as `allocate_daqp_workspace` and mpc_daqp.c have them."""
    n, rows, soft = program.inputs, len(program.rows), len(program.response)
    tables = n * (n + 1) // 2 + n * soft + rows + 2 * rows + rows * program.p.shape[1]
    active = n + soft + 1
    working = active * (active + 1) // 2 + 5 * active + 3 * n + 3 * rows
    return 8 * tables, 8 * working + 4 * (active + rows)
