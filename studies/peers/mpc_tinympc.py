"""TinyMPC's generated C++: ADMM whose linear step is an LQR of infinite horizon. No soft bounds: inputs only.

Three things follow from how version 0.0.8 is made. Its terminal cost is that LQR's, so that it is measured on a problem
with this terminal cost (of the same size). State weights are diagonal: the states are turned. And rho is added to the
weights twice: they are given less rho, without which its answers are those of other weights.
"""

import shutil
from dataclasses import dataclass
from importlib import resources
from pathlib import Path

import numpy as np
from scipy.linalg import solve_discrete_are

from .mpc_c import InC, build, table
from .mpc_case import Case, Program, predicted

RHO = 0.1


@dataclass(frozen=True, eq=False)
class Turned:
    """What TinyMPC is given: A, B, the diagonal weight of turned states, and what turns states and references."""

    A: np.ndarray
    B: np.ndarray
    weight: np.ndarray
    turn: np.ndarray
    wanted: np.ndarray


def turned(case: Case) -> Turned:
    """The model in states whose weight is diagonal, inputs in newtons."""
    values, vectors = np.linalg.eigh(case.Q * case.C.T @ case.C)
    weight = np.diag(np.where(values > 1e-9 * values.max(), values, 0))
    turn = vectors.T
    return Turned(turn @ case.A @ turn.T, turn @ case.B, weight, turn, turn @ np.linalg.pinv(case.C))


def terminal(case: Case) -> Program:
    """The inputs-only problem with TinyMPC's terminal cost, x'(P - rho)x / 2 - x'P C^+ r, the one that it solves."""
    model, N, n, m = turned(case), case.horizon, case.states, case.inputs
    P = solve_discrete_are(model.A, model.B, model.weight + RHO * np.eye(n), (case.R + RHO) * np.eye(m))
    forced, free = predicted(model.A, model.B * case.umax, N)
    weights, pull = np.kron(np.eye(N), model.weight), np.tile(model.weight, (N, 1))
    weights[-n:, -n:], pull[-n:] = P - RHO * np.eye(n), P
    hessian = forced.T @ weights @ forced + case.R * case.umax**2 * np.eye(N * m)
    gradient = forced.T @ np.hstack([weights @ free @ model.turn, -pull @ model.wanted])
    nothing = np.zeros((0, N * m)), np.zeros((0, n + case.outputs))
    return Program(hessian, gradient, *nothing, 0.0, case.p, m)


def tinympc_c(folder: Path, case: Case, *, warm: bool) -> InC:
    """The C++ that `TinyMPC.codegen` writes."""
    import tinympc  # pyright: ignore[reportMissingImports]

    model, n, m = turned(case), case.states, case.inputs
    solver = tinympc.TinyMPC()
    settings = {"abs_pri_tol": 4e-6, "abs_dua_tol": 4e-6, "max_iter": 1000, "check_termination": 1}
    less = model.weight - RHO * np.eye(n), (case.R - RHO) * np.eye(m)
    solver.setup(model.A, model.B, *less, case.horizon + 1, rho=RHO, **settings)
    solver.set_bound_constraints(None, None, np.full(m, -case.umax), np.full(m, case.umax))
    solver.update_settings(en_state_bound=False)
    folder.mkdir(parents=True, exist_ok=True)
    # Not `codegen`, which goes on to build a Python module with CMake.
    solver._solver.codegen(f"{folder}/", 0)
    with resources.as_file(resources.files("tinympc.codegen") / "codegen_src") as library:
        shutil.copytree(library, folder, dirs_exist_ok=True)
    sources = ["mpc_tinympc.cpp", folder / "src" / "tiny_data.cpp"]
    sources += [folder / "tinympc" / f"{name}.cpp" for name in ("admm", "rho_benchmark")]
    include = [folder / "include", folder / "include" / "Eigen"]
    tables = f"#define OUTPUTS {case.outputs}\n#define UMAX {case.umax!r}\n"
    tables += table("turn", model.turn) + table("reference", model.wanted)
    program = terminal(case)
    executable = build(folder, program, sources, include=include, link=["-lstdc++"], tables=tables)
    return InC(folder, program, executable, warm)
