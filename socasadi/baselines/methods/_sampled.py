import casadi as ca
import numpy as np

from ...plant import SimulatedPlant

_NUDGE = 1e-6
"""Of a difference quotient, in the units of state and input."""


def sampled(plant: SimulatedPlant, inputs: int, steps: int = 1) -> ca.Function:
    """(x, u) -> x a sample later, its derivatives by x and u, output then, its derivative by that state.

    The former are difference quotients, which cost far less than exact derivatives of a step. One integration step a
    sample is enough for control: with five J is the same to a thousandth.
    """
    n = 2 * plant.rod.dof
    x, u = ca.MX.sym("x", n), ca.MX.sym("u", inputs)  # pyright: ignore[reportArgumentType]
    step = plant.rod.step_expression(plant.sample_time, plant.sample_time / steps)
    moved = ca.repmat(ca.vertcat(x, u), 1, n + inputs + 1) + _NUDGE * ca.DM(np.eye(n + inputs, n + inputs + 1, k=1))
    flown = step.map(n + inputs + 1)(moved[:n, :], moved[n:, :], ca.DM.zeros(3, n + inputs + 1))
    after = flown[:, 0]
    slopes = (flown[:, 1:] - ca.repmat(after, 1, n + inputs)) / _NUDGE
    output = plant.sensor(after)
    at = ca.MX.sym("at", n)  # pyright: ignore[reportArgumentType]
    slope = ca.Function("slope", [at], [ca.densify(ca.jacobian(plant.sensor(at), at))])
    return ca.Function("advance", [x, u], [after, slopes, output, slope(after)])
