"""From one sample to the next with the tensions held.

The method is the two-stage W-method ROS2 (Verwer, Spee, Blom, Hundsdorfer, SIAM J. Sci. Comput. 20, 1999):

    (1 - gamma h A) k1 = f(x)                   gamma = 1 - 1/sqrt(2)
    (1 - gamma h A) k2 = f(x + h k1) - 2 k1
    x(t + h) = x + h (3 k1 + k2) / 2,

of order two for any matrix A, and L-stable when A is the Jacobian of f. With

    A = [[0, 1], [-M(q)^-1 K, -M(q)^-1 D]]

(K, D the constant elastic and viscous matrices, M the mass matrix at the beginning of the substep, which the first
stage has at hand) A holds all that is stiff in a rod, and eliminating the first block leaves one symmetric system
with M + gamma h D + (gamma h)^2 K per stage: no Jacobian, no iteration.

Why not CasADi's own linearly implicit integrator: for the preset "paper" (8 coordinates) after a step of 5 N,
studies/speed_rod.py gave, on one core of a small server, for the tip error at 1 s and the time of one compiled sample
of 50 ms:

    this method, substeps of 10 / 5 / 2.5 ms      7.2 / 1.8 / 0.45 um     37 / 72 / 148 us       1 s to compile
    "rosenbrock", one step of 50 ms               1.4 um                  346 us                 42 s to compile

Four to five times quicker at like accuracy, and compiled in a fortieth of the time.

The default substep, 1/250 of the period of the slowest mode of the straight rod, is 5 ms there. It follows the rod's
stiffness and mass: a rod that vibrates faster gets shorter substeps, for accuracy; the stiff strains (stretch,
torsion, high orders) do not enter it, because the method is stable for them.
"""

from math import ceil, sqrt

import casadi as ca

from ._checks import positive
from ._model import RodModel

SUBSTEPS_PER_PERIOD = 250
"""Substeps in one period of the slowest mode of the straight rod, by default."""

_GAMMA = 1 - 1 / sqrt(2)


def substeps(sample_time: float, substep: float) -> int:
    """How many equal substeps, none longer than ``substep``, make one sample."""
    positive("Rod.step", sample_time=sample_time, substep=substep)
    return max(1, ceil(sample_time / substep * (1 - 1e-12)))


def w_method(model: RodModel, sample_time: float, count: int) -> ca.Function:
    """(x, tension, tip_force) -> x one sample later, in ``count`` substeps."""
    n, h = model.stiffness.shape[0], sample_time / count
    x, u, tip_force = ca.MX.sym("x", 2 * n), ca.MX.sym("tension", model.rhs.numel_in(1)), ca.MX.sym("tip_force", 3)
    g, K = _GAMMA * h, model.stiffness
    shift = ca.DM(ca.tril(ca.densify(g * model.damping_matrix + g**2 * K)))

    lower, force = model.motion(x, u, tip_force)
    shifted = lower + shift

    def solve(r1: ca.MX, r2: ca.MX) -> tuple[ca.MX, ca.MX]:
        """(1 - gamma h A)^-1 [r1; M^-1 r2]"""
        b = model.solve(shifted, r2 - g * (K @ r1))
        return r1 + g * b, b

    a1, b1 = solve(x[n:], force)
    later = x + h * ca.vertcat(a1, b1)
    lower2, force2 = model.motion(later, u, tip_force)
    acceleration = model.solve(lower2, force2) - 2 * b1
    a2, b2 = solve(later[n:] - 2 * a1, ca.mtimes(ca.tril2symm(lower), acceleration))
    advanced = x + h / 2 * ca.vertcat(3 * a1 + a2, 3 * b1 + b2)
    once = ca.Function("substep", [x, u, tip_force], [advanced])

    end = x
    for _ in range(count):
        end = once(end, u, tip_force)
    return ca.Function("rod_step", [x, u, tip_force], [end], ["x", "tension", "tip_force"], ["x_next"])


def reference(model: RodModel, sample_time: float) -> ca.Function:
    """The same map as :func:`w_method` by CVODES at tolerance 1e-11."""
    n = model.stiffness.shape[0]
    x, u, tip_force = ca.MX.sym("x", 2 * n), ca.MX.sym("tension", model.rhs.numel_in(1)), ca.MX.sym("tip_force", 3)
    ode = {"x": x, "p": ca.vertcat(u, tip_force), "ode": model.forced_rhs(x, u, tip_force)}
    options = {"reltol": 1e-11, "abstol": 1e-11, "max_num_steps": 1_000_000}
    integrator = ca.integrator("reference", "cvodes", ode, 0.0, sample_time, options)
    end = integrator(x0=x, p=ca.vertcat(u, tip_force))["xf"]
    return ca.Function("reference_step", [x, u, tip_force], [end], ["x", "tension", "tip_force"], ["x_next"])
