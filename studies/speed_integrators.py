"""How one sample of the rod is best integrated: the package's W-method against CasADi's own linearly implicit method.

    python studies/speed_integrators.py

For the preset "paper" after a step of 5 N on one cable: error of the tip at 1 s against CVODES at a tolerance of 1e-11,
wall time of one compiled sample of 50 ms, and how long code generation and the C compiler took together (from an
empty cache). CasADi's method takes the compiler the better part of a minute.
"""

import os
import tempfile
import time
from collections.abc import Callable

import casadi as ca
import numpy as np

from socasadi import Rod
from socasadi.codegen import Buffered, compiled

SAMPLE, TENSION, NO_FORCE = 0.05, np.array([5.0, 0.0, 0.0]), np.zeros(3)


def main() -> None:
    rod = Rod.preset("paper")
    methods: dict[str, Callable[[], ca.Function]] = {
        f"W-method, substeps of {1e3 * substep:g} ms": lambda substep=substep: rod.step_expression(SAMPLE, substep)
        for substep in (0.01, 0.005, 0.0025)
    }
    methods["rosenbrock, one step of 50 ms"] = lambda: rosenbrock(rod, steps=1)
    wanted = tip_after_a_second(rod, rod.reference_step(SAMPLE))
    print(f"{'':32} {'tip error / um':>15} {'sample / us':>12} {'compiled in / s':>16}")
    with tempfile.TemporaryDirectory() as cache:
        os.environ["SOCASADI_CACHE"] = cache
        for name, make in methods.items():
            start = time.perf_counter()
            step = compiled(make())
            built = time.perf_counter() - start
            error = 1e6 * np.linalg.norm(tip_after_a_second(rod, step) - wanted)
            print(f"{name:32} {error:15.3f} {1e6 * sample_time(rod, step):12.1f} {built:16.1f}", flush=True)


def rosenbrock(rod: Rod, steps: int) -> ca.Function:
    x, u, force = ca.MX.sym("x", 2 * rod.dof), ca.MX.sym("u", len(rod.cables)), ca.MX.sym("force", 3)
    ode = {"x": x, "p": ca.vertcat(u, force), "ode": rod.forced_rhs(x, u, force)}
    options = {"step_size": SAMPLE / steps}
    integrator = ca.integrator("sample", "rosenbrock", ode, 0.0, SAMPLE, options)
    return ca.Function("rosenbrock", [x, u, force], [integrator(x0=x, p=ca.vertcat(u, force))["xf"]])


def tip_after_a_second(rod: Rod, step: ca.Function) -> np.ndarray:
    x = np.zeros(2 * rod.dof)
    for _ in range(round(1 / SAMPLE)):
        x = step(x, TENSION, NO_FORCE).full()[:, 0]
    return rod.tip(x[: rod.dof]).full()[:, 0]


def sample_time(rod: Rod, step: ca.Function, repetitions: int = 2000) -> float:
    """Median wall time of a sample, s."""
    call, x, spent = Buffered(step), np.zeros(2 * rod.dof), []
    for _ in range(repetitions):
        start = time.perf_counter()
        (x,) = call(x, TENSION, NO_FORCE)
        spent.append(time.perf_counter() - start)
    return float(np.median(spent))


if __name__ == "__main__":
    main()
