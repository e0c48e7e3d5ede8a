"""The whole controller: in C on the tracking problems, and at work in closed loop, in C and in Python.

In closed loop the specification is the default one, its model that of the tracking problem, which is also the plant,
with 1 mm of sensor noise; the reference jumps every 20 samples, also beyond the bounds of the outputs.
"""

import time
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from socasadi import LinearMPC, Modal
from socasadi.model import StateSpace
from socasadi.mpc import tables

from .mpc_c import InC, build, table
from .mpc_case import Case, Program
from .mpc_socasadi import LIBRARY


@dataclass(frozen=True, eq=False)
class Loop:
    """What comes in, measurements and references (count, outputs + outputs), and the programs that are to be solved."""

    mpc: LinearMPC
    system: StateSpace
    seen: np.ndarray
    program: Program


def placed(case: Case) -> Loop:
    """The tracking problems themselves: what is seen begins with the state to which the observer comes."""
    mpc = LinearMPC(
        Modal(),
        horizon=case.horizon,
        preview=1,
        Q=case.Q,
        R=case.R,
        input_term="literal",
        input_bounds=(-case.umax, case.umax),
        output_bounds=(-case.ymax, case.ymax) if case.soft else None,
        slack_weight=case.rho if case.soft else 1.0,
        terminal=None,
    )
    x, r = np.hsplit(case.p, [case.states])
    undisturbed = np.zeros((len(x), case.outputs))
    return Loop(mpc, _system(case), np.hstack([x, undisturbed, x @ case.C.T, r]), case.program)


def closed_loop(case: Case, samples: int = 400) -> Loop:
    """An episode of the default specification."""
    mpc = LinearMPC(Modal(), horizon=case.horizon, preview=1)
    system = _system(case)
    controller, random = mpc.controller_for(system), np.random.default_rng(0)
    design = controller.design
    x, u, seen, parameters = np.zeros(case.states), np.zeros(case.inputs), [], []
    for k in range(samples):
        x = case.A @ x + case.B @ u
        y, r = case.C @ x + 1e-3 * random.normal(size=case.outputs), case.p[k // 20, case.states :]
        before, u = u, controller.step(y, r)
        seen.append(np.concatenate([y, r]))
        parameters.append(design.parameters(np.concatenate(controller.estimate), before / case.umax, r))
    moves = len(design.hessian)
    response, free = design.rows[moves:], design.row_free[moves:]
    softening = float(design.quadratic[moves])
    qp = design.hessian, design.gradient, response, free, softening
    return Loop(mpc, system, np.array(seen), Program(*qp, np.array(parameters), case.inputs))


def _system(case: Case) -> StateSpace:
    return StateSpace(case.A, case.B, case.C, np.zeros((case.outputs, case.inputs)))


def step_c(folder: Path, loop: Loop, *, warm: bool = True, placed: bool = False) -> InC:
    """mpc_step, for what came in."""
    given = tables(loop.mpc, loop.mpc.design(loop.system))
    numbers = {f"data_{k}": v for k, v in (given.sizes | given.limits).items()}
    numbers["qp_iterations"] = given.program.iterations
    arrays = {f"data_{k}": v for k, v in given.arrays.items()} | {f"qp_{k}": v for k, v in given.program.arrays.items()}
    text = "".join(f"#define {name} {value!r}\n" for name, value in numbers.items())
    text += "\n".join(table(name, values) for name, values in arrays.items()) + "\n"
    back = np.linalg.inv(given.arrays["A"].reshape(2 * (given.sizes["order"],)))
    text += table("data_back", back)
    define = ["PLACED"] if placed else []
    program = replace(loop.program, p=loop.seen)
    sources = ["mpc_step.c", *(LIBRARY / f"{part}.c" for part in ("mpc", "qp", "qp_residual"))]
    executable = build(folder, program, sources, include=[LIBRARY], define=define, tables=text)
    return InC(folder, program, executable, warm)


def step_python(loop: Loop, backend: str) -> tuple[str, np.ndarray]:
    """The kind of controller with its fallbacks, if any, and seconds (count,) of its `step` in Python."""
    controller = replace(loop.mpc, backend=backend).controller_for(loop.system)
    seconds = np.zeros(len(loop.seen))
    y, r = np.hsplit(loop.seen, 2)
    for k in range(len(seconds)):
        begin = time.perf_counter()
        controller.step(y[k], r[k])
        seconds[k] = time.perf_counter() - begin
    fallbacks = controller.info.fallbacks
    return type(controller).__name__ + (f", {fallbacks} fallbacks" if fallbacks else ""), seconds
