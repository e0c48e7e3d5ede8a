"""How fast one solution of the tracking QP is, by this package's solver and by others; then the whole controller.

    pip install socasadi[peers]
    python studies/speed_mpc.py [--rounds N] [--only NAME] [--figure]

Every solver gets the same 200 problems (studies/peers/mpc_case.py), the best settings that we found for it, and one
core. The solvers take turns, a round of all problems each, and a problem's time is the best of its rounds: from
parameters to the first input, by the monotonic clock. Every answer, of all inputs, is measured by the same independent
residual, a share of the largest input; tolerances are such that 1e-6 is reached where it can be. "Warm" starts from
the problem before, an unrelated one. Caches are warm throughout.
"""

import argparse
import contextlib
import os
import subprocess
import tempfile
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from typing import Protocol

import matplotlib.pyplot as plt
import numpy as np

os.environ.update(dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1"))
warnings.filterwarnings("ignore", category=FutureWarning)  # CasADi's, of how others call it

from peers import mpc_casadi, mpc_cvxpygen, mpc_daqp, mpc_dompc, mpc_hpipm, mpc_osqp, mpc_python, mpc_tinympc  # noqa: E402
from peers.mpc_c import InC, build  # noqa: E402
from peers.mpc_case import Case, Program, case, random_case  # noqa: E402
from peers.mpc_socasadi import socasadi_bytes, socasadi_qp  # noqa: E402

FIGURE = Path(__file__).parent / "figures" / "mpc-growth.png"


class Solver(Protocol):
    def round(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]: ...
    def close(self) -> None: ...


@dataclass(frozen=True)
class Entry:
    """A solver to be measured: `make(folder, case)` sets it up; of the rounds it takes this share.

    `solved` is the program that its answers are measured by.
    """

    name: str
    make: Callable[[Path, Case], Solver]
    share: float = 1.0
    solved: Callable[[Case], Program] = lambda case: case.program
    soft: bool = True


def python(make: Callable[[Program], mpc_python.Solve]) -> Callable[[Path, Case], Solver]:
    return lambda _, case: mpc_python.InPython(case.program, make(case.program))


def empty(folder: Path, case: Case) -> Solver:
    return InC(folder, case.program, build(folder, case.program, ["mpc_empty.c"]), warm=True)


def whole_step(folder: Path, case: Case, warm: bool) -> Solver:
    from peers import mpc_loop  # the package is missed by nobody else

    return mpc_loop.step_c(folder, mpc_loop.placed(case), warm=warm, placed=True)


ENTRIES = [
    Entry("the clock alone", empty),
    *(
        Entry(
            f"socasadi active-set, {start}{', with KKT check' if checked else ''}",
            lambda f, c, warm=start == "warm", checked=checked: socasadi_qp(f, c.program, warm=warm, checked=checked),
        )
        for checked in (False, True)
        for start in ("cold", "warm")
    ),
    *(
        Entry(f"socasadi's whole mpc_step, {start}", lambda f, c, warm=start == "warm": whole_step(f, c, warm))
        for start in ("cold", "warm")
    ),
    Entry("DAQP in C, all set up, cold", lambda f, c: mpc_daqp.daqp_c(f, c.program, warm=False)),
    Entry("DAQP in C, all set up, warm", lambda f, c: mpc_daqp.daqp_c(f, c.program, warm=True)),
    Entry("OSQP's generated C, cold", lambda f, c: mpc_osqp.osqp_c(f, c.program, warm=False)),
    Entry("OSQP's generated C, warm", lambda f, c: mpc_osqp.osqp_c(f, c.program, warm=True)),
    Entry("HPIPM in C, dense", lambda f, c: mpc_hpipm.hpipm_c(f, c.program)),
    Entry("CVXPYgen's C with OSQP", lambda f, c: mpc_cvxpygen.cvxpygen_c(f, c.program)),
    Entry(
        "TinyMPC's C++, with its own terminal cost",
        lambda f, c: mpc_tinympc.tinympc_c(f, c, warm=True),
        solved=mpc_tinympc.terminal,
        soft=False,
    ),
    Entry("CasADi's generated C with daqp", lambda f, c: mpc_casadi.casadi_c(f, c.program, plugin="daqp")),
    Entry("CasADi's generated C with osqp", lambda f, c: mpc_casadi.casadi_c(f, c.program, plugin="osqp")),
    Entry("Python: daqp", python(mpc_python.daqp_python), 0.2),
    Entry("Python: osqp", python(mpc_python.osqp_python), 0.2),
    Entry("Python: piqp", python(mpc_python.piqp_python), 0.2),
    Entry("Python: clarabel", python(mpc_python.clarabel_python), 0.1),
    Entry("Python: qpOASES in CasADi", python(lambda p: mpc_casadi.casadi_interpreted(p, plugin="qpoases")), 0.2),
    Entry("Python: do-mpc with IPOPT", lambda _, c: mpc_python.InPython(c.program, mpc_dompc.dompc_python(c)), 0.05),
]


def main() -> None:
    parser = argparse.ArgumentParser(description="One solution of the tracking QP, by this package and by others.")
    parser.add_argument("--rounds", type=int, default=40, help="rounds of the solvers in C (40); slow ones do fewer")
    parser.add_argument("--only", default="", help="only solvers whose name has this in it")
    parser.add_argument("--figure", action="store_true", help="also how time and memory grow, as a figure")
    chosen = parser.parse_args()
    if not any(chosen.only.lower() in entry.name.lower() for entry in ENTRIES):
        names = "\n  ".join(entry.name for entry in ENTRIES)
        parser.exit(2, f"--only: no solver has {chosen.only!r} in its name; there are\n  {names}\n")
    print(versions())
    os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})
    with tempfile.TemporaryDirectory() as folder:
        for soft in (True, False):
            compare(Path(folder), case(soft), chosen.rounds, chosen.only)
        if chosen.only.lower() in "socasadi":
            controllers(Path(folder), chosen.rounds)
        if chosen.figure:
            growth(Path(folder), max(1, chosen.rounds // 4))


def versions() -> str:
    """What is compared, as far as it is installed, and the compiler."""
    known = []
    for name in ("casadi", "osqp", "cvxpygen", "tinympc", "daqp", "piqp", "clarabel", "do-mpc"):
        with contextlib.suppress(metadata.PackageNotFoundError):
            known.append(f"{name} {metadata.version(name)}")
    compiler = subprocess.run(["gcc", "--version"], capture_output=True, text=True).stdout.partition("\n")[0]
    return ", ".join([*known, compiler])


def compare(folder: Path, case: Case, rounds: int, only: str) -> None:
    """The table of one problem."""
    solvers: list[tuple[Entry, Solver]] = []
    title = "soft outputs" if case.soft else "inputs only"
    heading(title)
    for entry in ENTRIES:
        if only.lower() not in entry.name.lower():
            continue
        if case.soft and not entry.soft:
            print(f"{entry.name}: has no soft bounds")
            continue
        try:
            solvers.append((entry, entry.make(folder / f"{title} {entry.name}", case)))
        except ModuleNotFoundError as missing:
            print(f"{entry.name}: not installed ({missing.name} is missing): pip install socasadi[peers]")
        except Exception as error:
            print(f"{entry.name}: failed: {type(error).__name__}: {str(error)[:200]}")
    everything = take_turns([(solver, entry.share) for entry, solver in solvers], rounds)
    for (entry, _), answers in zip(solvers, everything, strict=True):
        show(entry.name, *answers, entry.solved(case))
    best = {entry.name: answers[0] for (entry, _), answers in zip(solvers, everything, strict=True)}
    for start in ("cold", "warm"):
        names = f"socasadi's whole mpc_step, {start}", f"socasadi active-set, {start}"
        if all(name in best for name in names):
            step, qp = (np.quantile(best[name], (0.5, 0.99)) for name in names)
            print("mpc_step / QP, {}: {:.2f} at the median, {:.2f} at 99 %".format(start, *(step / qp)))


def take_turns(solvers: list[tuple[Solver, float]], rounds: int) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Best seconds of each problem, and the last round's iterations and answers, by solver with its share of rounds."""
    results: list[list] = [[] for _ in solvers]
    for turn in range(rounds):
        for (solver, share), done in zip(solvers, results, strict=True):
            if turn * share >= len(done):
                done.append(solver.round())
    for solver, _ in solvers:
        solver.close()
    return [(np.min([seconds for seconds, _, _ in done], axis=0), *done[-1][1:]) for done in results]


def controllers(folder: Path, rounds: int) -> None:
    """The whole controller beside its quadratic program, on the problems that it meets in closed loop."""
    from peers import mpc_loop

    loop = mpc_loop.closed_loop(case(soft=True))
    makes: dict[str, Callable[[Path], Solver]] = {
        "DAQP in C, all set up, warm": lambda f: mpc_daqp.daqp_c(f, loop.program, warm=True),
        "socasadi active-set, warm": lambda f: socasadi_qp(f, loop.program, warm=True, checked=False),
        "socasadi active-set, warm, with KKT check": lambda f: socasadi_qp(f, loop.program, warm=True, checked=True),
        "socasadi's whole mpc_step, warm": lambda f: mpc_loop.step_c(f, loop),
    }
    heading("default MPC in closed loop, soft outputs")
    solvers = [(make(folder / f"loop {name}"), 1.0) for name, make in makes.items()]
    results = dict(zip(makes, take_turns(solvers, rounds), strict=True))
    for name, answers in results.items():
        show(name, *answers, loop.program)
    print(f"\n{'controller.step in Python, soft outputs, microseconds':52} {'median':>8} {'99 %':>8} {'worst':>8}")
    for backend in ("active-set", "daqp", "osqp", "qpoases"):
        with mpc_casadi.silent():
            runs = [mpc_loop.step_python(loop, backend) for _ in range(max(2, rounds // 10))]
        seconds = np.min([seconds for _, seconds in runs], axis=0)
        show(f"{backend} ({runs[0][0]})", seconds)


def heading(title: str) -> None:
    numbers = f"{'median':>8} {'99 %':>8} {'worst':>8}  {'residual':>8} {'largest':>8}  iterations"
    print(f"\n{title + ', microseconds':52} {numbers}")


def show(
    name: str,
    seconds: np.ndarray,
    iterations: np.ndarray | None = None,
    z: np.ndarray | None = None,
    program: Program | None = None,
) -> None:
    """One line; without a program, of the times alone."""
    times = [1e6 * value for value in (np.median(seconds), np.percentile(seconds, 99), seconds.max())]
    line = f"{name:52} " + " ".join(f"{value:8.2f}" for value in times)
    if program is not None and iterations is not None and z is not None and np.isfinite(z).all():
        residual = program.residual(z)
        line += f"  {np.median(residual):8.0e} {residual.max():8.0e}"
        if iterations.any():
            line += f"  {np.median(iterations):.0f} to {iterations.max():.0f}"
        failures = int((iterations < 0).sum())
        line += f", {failures} given up" if failures else ""
    print(line, flush=True)


def growth(folder: Path, rounds: int) -> None:
    """Time and memory by horizon and by states, for random models, cold, as numbers and as a figure."""
    by_horizon = [(n, random_case(4, n)) for n in (5, 10, 15, 20, 30, 40, 50)]
    by_states = [(n, random_case(n)) for n in (2, 4, 6, 8, 10, 12)]
    figure, axes = plt.subplots(2, 2, figsize=(9, 6.5), sharex="col", layout="constrained")
    columns = (by_horizon, "horizon (4 states)"), (by_states, "states (horizon 10)")
    for (times, sizes), (cases, label) in zip(axes.T, columns, strict=True):
        print(f"\n{label:52} {'median':>8} {'99 %':>8}  microseconds {'tables':>8} {'working':>8} kB")
        for name, colour, make, measure in (
            ("socasadi active-set", "C0", socasadi_cold, socasadi_bytes),
            ("DAQP", "C1", daqp_cold, mpc_daqp.daqp_bytes),
        ):
            curves = []
            for n, problem in cases:
                solver = make(folder / f"growth {name} {label} {n}", problem.program)
                ((seconds, iterations, z),) = take_turns([(solver, 1.0)], rounds)
                residual, failures = problem.program.residual(z).max(), int((iterations < 0).sum())
                numbers = *(1e6 * np.quantile(seconds, (0.5, 0.99))), *(np.array(measure(problem.program)) / 1e3)
                curves.append(numbers)
                said = "{:8.2f} {:8.2f} {:22.1f} {:8.1f}".format(*numbers)
                print(
                    f"{f'{name}, {n}':52} {said}  residual {residual:.0e}{f', {failures} given up' if failures else ''}"
                )
            x, median, slow, tables, working = [n for n, _ in cases], *zip(*curves, strict=True)
            times.plot(x, median, ".-", color=colour, label=f"{name}, median")
            times.plot(x, slow, ".--", color=colour, label=f"{name}, 99 %")
            sizes.plot(x, tables, ".-", color=colour, label=f"{name}, tables")
            sizes.plot(x, working, ".--", color=colour, label=f"{name}, working memory")
        for axis in (times, sizes):
            axis.set(yscale="log", xticks=[n for n, _ in cases])
            axis.grid(alpha=0.3)
        sizes.set_xlabel(label)
    axes[0, 0].set_ylabel("one solution, soft outputs, us")
    axes[1, 0].set_ylabel("memory in double precision, kB")
    for axis in axes[:, 1]:
        axis.legend(fontsize="small", loc="upper left")
    for left, right in axes:
        limits = np.array([left.get_ylim(), right.get_ylim()])
        for axis in (left, right):
            axis.set_ylim(limits.min(), limits.max())
    figure.suptitle("A dual active-set solution with everything set up: three inputs, two outputs")
    figure.savefig(FIGURE, dpi=150)
    print(f"\n{FIGURE}")


def socasadi_cold(folder: Path, program: Program) -> Solver:
    return socasadi_qp(folder, program, warm=False, checked=False)


def daqp_cold(folder: Path, program: Program) -> Solver:
    return mpc_daqp.daqp_c(folder, program, warm=False)


if __name__ == "__main__":
    main()
