"""From one sample to the next with the tensions held.

The method is the two-stage W-method ROS2 (Verwer, Spee, Blom, Hundsdorfer, SIAM J. Sci. Comput. 20, 1999):

    (1 - gamma h A) k1 = f(x)                   gamma = 1 - 1/sqrt(2)
    (1 - gamma h A) k2 = f(x + h k1) - 2 k1
    x(t + h) = x + h (3 k1 + k2) / 2,

of order two for any matrix A, and L-stable when A is the Jacobian of f. Here

    A = [[0, 1], [-M(q)^-1 K(q), -M(q)^-1 D(q)]]

holds all that is stiff in a rod: K is the constant elastic matrix and what taut cables of given length add, D the
constant viscous one and what drag adds, M the mass matrix. Each stage takes A where it evaluates f, which leaves the
order at two (A differs by O(h) between the stages, the result by O(h^3)), and multiplies by M: one symmetric system
with M + gamma h D + (gamma h)^2 K a stage, no Jacobian, no iteration. With the first stage's A in both, the second
would have M(q1) M(q2)^-1 before its stiff forces, and slender rods, whose inertia in torsion changes a hundredfold as
they bend, would blow up at moderate steps.

Why not CasADi's own linearly implicit integrator: for the preset "paper" (8 coordinates) after a step of 5 N,
studies/speed_integrators.py gave, on one core of a small server, for the tip error at 1 s and the time of one compiled
sample of 50 ms:

    this method, substeps of 10 / 5 / 2.5 ms      7.0 / 1.8 / 0.45 um     24 / 46 / 96 us        0.8 s to compile
    "rosenbrock", one step of 50 ms               1.4 um                  188 us                 32 s to compile

Four times quicker at like accuracy, and compiled in a fortieth of the time.

The default substep is 1/250 of the period of the slowest mode of the straight rod or 1/40 of that of the fourth slowest
(the second of both bending axes), whichever is shorter: 5 ms there. It follows the rod's stiffness and mass: a rod that
vibrates faster gets shorter substeps, for accuracy; the stiffer strains do not enter it.
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

_SUBSTEPS = {0: 250, 3: 40}  # in a period of the slowest mode of the straight rod, and of the fourth, by default
_GAMMA = 1 - 1 / sqrt(2)


def substeps(rod: Rod, sample_time: float, substep: float | None) -> int:
    """How many equal substeps, none longer than ``substep``, make a sample; by default it follows the slow modes."""
    if substep is None:
        frequency = modes(rod, rod.stiffness.full(), np.zeros(rod.dof)).frequency
        substep = min(1 / (count * float(frequency[i])) for i, count in _SUBSTEPS.items() if i < rod.dof)
    positive_number("Rod.step", sample_time=sample_time, substep=substep)
    return max(1, ceil(sample_time / substep * (1 - 1e-12)))


def w_method(model: RodModel, sample_time: float, count: int) -> ca.Function:
    """(x, tension, tip_force) -> x one sample later, in ``count`` substeps; free parameters come last."""
    (x, u, tip_force), n = _arguments(model), model.solve.numel_in(1)
    h = sample_time / count
    g, K, D = _GAMMA * h, model.stiffness, model.damping_matrix
    shift = ca.tril(ca.densify(g * D + g**2 * K))

    tip = dead_force(tip_force)

    def stage(x: ca.MX, before: ca.MX) -> ca.MX:
        """(1 - gamma h A(x))^-1 (f(x) - before)"""
        mass, force, spring, drag = model.loaded_motion(x, u, tip, *model.free)
        r1 = x[n:] - before[:n]
        r2 = force - ca.tril2symm(mass) @ before[n:] - g * (K @ r1 + ca.tril2symm(spring) @ r1)
        b = model.solve(mass + shift + g**2 * spring + g * drag, r2)
        return ca.vertcat(r1 + g * b, b)

    first = stage(x, ca.MX(2 * n, 1))
    second = stage(x + h * first, 2 * first)
    advanced = x + h / 2 * (3 * first + second)
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
