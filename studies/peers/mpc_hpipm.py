"""HPIPM in C, the library and the headers in CasADi's wheel: interior points, dense, with its own soft rows.

(CasADi's plugin for it, which wants the problem stage by stage, crashes in version 3.8.2.)
"""

from pathlib import Path

import casadi as ca

from .mpc_c import InC, build
from .mpc_case import Program

PACKAGE = Path(str(ca.__file__)).parent


def hpipm_c(folder: Path, program: Program) -> InC:
    """`d_dense_qp_ipm_solve`; a start from the problem before does not help it."""
    link = [PACKAGE / "libhpipm.so", PACKAGE / "libblasfeo.so", f"-Wl,-rpath,{PACKAGE}"]
    executable = build(folder, program, ["mpc_hpipm.c"], include=[PACKAGE / "include"], link=link)
    return InC(folder, program, executable, warm=False)
