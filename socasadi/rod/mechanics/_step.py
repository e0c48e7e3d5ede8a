"""From one sample to the next with the tensions held.

The method is the two-stage W-method ROS2 (Verwer, Spee, Blom, Hundsdorfer, SIAM J. Sci. Comput. 20, 1999):

    (1 - gamma h A) k1 = f(x)                   gamma = 1 - 1/sqrt(2)
    (1 - gamma h A) k2 = f(x + h k1) - 2 k1
    x(t + h) = x + h (3 k1 + k2) / 2,

of order two for any matrix A, and L-stable when A is the Jacobian of f. With

    A = [[0, 1], [-M(q)^-1 K(q), -M(q)^-1 D(q)]]

(M the mass matrix at the beginning of the substep, which the first stage has at hand; K the constant elastic matrix and
what taut cables of given length add, D the constant viscous one and what drag adds) A holds all that is stiff in a rod,
and eliminating the first block leaves one symmetric system with M + gamma h D + (gamma h)^2 K per stage: no Jacobian,
no iteration.

Why not CasADi's own linearly implicit integrator: for the preset "paper" (8 coordinates) after a step of 5 N,
studies/speed_integrators.py gave, on one core of a small server, for the tip error at 1 s and the time of one compiled
sample of 50 ms:

    this method, substeps of 10 / 5 / 2.5 ms      7.2 / 1.8 / 0.45 um     26 / 51 / 98 us        0.8 s to compile
    "rosenbrock", one step of 50 ms               1.4 um                  179 us                 33 s to compile

Three to four times quicker at like accuracy, and compiled in a fortieth of the time.

The default substep, 1/250 of the period of the slowest mode of the straight rod, is 5 ms there. It follows the rod's
stiffness and mass: a rod that vibrates faster gets shorter substeps, for accuracy; the stiff strains (stretch,
torsion, high orders) do not enter it, because the method is stable for them.
"""

from __future__ import annotations

from math import ceil, sqrt
from typing import TYPE_CHECKING, Literal

import casadi as ca
import numpy as np

from .._checks import positive_number
from ._linear import modes
from ._model import RodModel, dead_force

if TYPE_CHECKING:
    from .._rod import Rod

_SUBSTEPS_PER_PERIOD = 250  # of the slowest mode of the straight rod, by default
_GAMMA = 1 - 1 / sqrt(2)


def substeps(rod: Rod, sample_time: float, substep: float | None) -> int:
    """How many equal substeps, none longer than ``substep``, make a sample; by default it follows the slowest mode."""
    if substep is None:
        slowest = modes(rod, rod.stiffness.full(), np.zeros(rod.dof)).frequency[0]
        substep = 1 / (_SUBSTEPS_PER_PERIOD * float(slowest))
    positive_number("Rod.step", sample_time=sample_time, substep=substep)
    return max(1, ceil(sample_time / substep * (1 - 1e-12)))


def w_method(model: RodModel, sample_time: float, count: int) -> ca.Function:
    """(x, tension, tip_force) -> x one sample later, in ``count`` substeps; free parameters come last."""
    (x, u, tip_force), n = _arguments(model), model.solve.numel_in(1)
    h = sample_time / count
    g, K, D = _GAMMA * h, model.stiffness, model.damping_matrix
    shift = ca.tril(ca.densify(g * D + g**2 * K))

    tip = dead_force(tip_force)
    mass, force, spring, drag = model.loaded_motion(x, u, tip, *model.free)
    shifted = mass + shift + g**2 * spring + g * drag
    K = K + ca.tril2symm(spring)

    def solve(r1: ca.MX, r2: ca.MX) -> tuple[ca.MX, ca.MX]:
        """(1 - gamma h A)^-1 [r1; M^-1 r2]"""
        b = model.solve(shifted, r2 - g * (K @ r1))
        return r1 + g * b, b

    a1, b1 = solve(x[n:], force)
    later = x + h * ca.vertcat(a1, b1)
    mass2, force2, *_ = model.loaded_motion(later, u, tip, *model.free)
    acceleration = model.solve(mass2, force2) - 2 * b1
    a2, b2 = solve(later[n:] - 2 * a1, ca.mtimes(ca.tril2symm(mass), acceleration))
    advanced = x + h / 2 * ca.vertcat(3 * a1 + a2, 3 * b1 + b2)
    once = ca.Function("substep", [x, u, tip_force, *model.free], [advanced])

    end = x
    for _ in range(count):
        end = once(end, u, tip_force, *model.free)
    return _map("rod_step", model, x, u, tip_force, end)


def reference(model: RodModel, sample_time: float, method: Literal["cvodes", "collocation"], count: int) -> ca.Function:
    """The same map by an integrator of CasADi's."""
    x, u, tip_force = _arguments(model)
    given = ca.vertcat(u, tip_force, *model.free)
    ode = {"x": x, "p": given, "ode": model.forced_rhs(x, u, tip_force, *model.free)}
    options = {
        "cvodes": {"reltol": 1e-11, "abstol": 1e-11, "max_num_steps": 1_000_000},
        "collocation": {
            "number_of_finite_elements": count,
            "interpolation_order": 4,
            "rootfinder": "newton",
            "rootfinder_options": {"abstol": 1e-12},
        },
    }[method]
    integrator = ca.integrator("reference", method, ode, 0.0, sample_time, options)
    return _map("reference_step", model, x, u, tip_force, integrator(x0=x, p=given)["xf"])


def _arguments(model: RodModel) -> tuple[ca.MX, ca.MX, ca.MX]:
    x, u = (ca.MX.sym(name, model.motion.numel_in(i)) for i, name in enumerate(("x", "tension")))
    return x, u, ca.MX.sym("tip_force", 3)


def _map(name: str, model: RodModel, x: ca.MX, u: ca.MX, tip_force: ca.MX, end: ca.MX) -> ca.Function:
    names = ["x", "tension", "tip_force"] + ["p"] * len(model.free)
    return ca.Function(name, [x, u, tip_force, *model.free], [end], names, ["x_next"])
