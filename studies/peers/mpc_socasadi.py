"""This package's own solver, in C."""

import subprocess
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from .mpc_c import InC, build, row_map, table
from .mpc_case import Program

LIBRARY = Path(str(find_spec("socasadi").origin)).parent / "mpc" / "c"  # pyright: ignore[reportOptionalMemberAccess]


def socasadi_qp(folder: Path, program: Program, *, warm: bool, checked: bool) -> InC:
    """qp_solve for given centres, with its KKT check or without."""
    sources = ["mpc_socasadi.c", LIBRARY / "qp.c", LIBRARY / "qp_residual.c"]
    define = ["CHECKED"] if checked else []
    executable = build(folder, program, sources, include=[LIBRARY], define=define, tables=dual(program))
    return InC(folder, program, executable, warm)


def dual(program: Program) -> str:
    """The problem in its dual, as qp.h has it, as C tables."""
    rows = program.rows
    gram = rows @ np.linalg.solve(program.hessian, rows.T)
    softness = np.zeros(len(rows))
    softness[program.inputs :] = 1 / program.softening if program.soft else 0
    scale = 1 / np.sqrt(np.diag(gram) + softness)
    gram = scale[:, None] * gram * scale
    tables = {
        "gram": gram[np.tril_indices(len(rows))],
        "lower": -scale,
        "upper": scale,
        "softness": scale**2 * softness,
        "price": np.zeros(len(rows)),
        "unit": 1 / scale,
        "map": (scale[:, None] * row_map(program)).T,
    }
    return "\n".join(table(name, values) for name, values in tables.items()) + "\n"


def socasadi_bytes(program: Program) -> tuple[int, int]:
    """Tables and working memory, in double precision, as qp.h and mpc_socasadi.c have them."""
    rows = len(program.rows)
    ask = f'printf("%d %d", QP_REALS({rows}), QP_INTS({rows}));'
    ask = f'#include <stdio.h>\n#include "qp.h"\nint main(void) {{ {ask} }}'
    with TemporaryDirectory() as folder:
        command = ["gcc", f"-I{LIBRARY}", "-x", "c", "-", "-o", f"{folder}/sizes"]
        subprocess.run(command, input=ask, text=True, check=True)
        reals, ints = map(int, subprocess.check_output([f"{folder}/sizes"], text=True).split())
    tables = rows * (rows + 1) // 2 + 5 * rows + rows * program.p.shape[1]
    return 8 * tables, 8 * (reals + rows) + 4 * ints
