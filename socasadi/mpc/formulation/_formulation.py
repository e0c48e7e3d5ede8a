"""From a prediction model to the numbers of its controller: one CasADi expression, so differentiable in the model."""

from typing import TYPE_CHECKING

import casadi as ca
import numpy as np

from ._augment import System, disturbed, queued
from ._condense import predict
from ._constraints import constraint_rows
from ._cost import StageCost, Term, cost_to_go, horizon_terms, idle_weight, last_deviation, steady_state
from ._moves import changes, held, previewed
from ._observer import kalman_gain
from ._parameters import Parameters
from ._target import at_rest, middle, steady_target
from ._weights import weight_matrix

if TYPE_CHECKING:
    from .._spec import LinearMPC

NUMBERS = (
    *("A", "B", "E", "C", "D", "F", "gain", "rest"),
    *("hessian", "gradient", "rows", "row_free", "row_lower", "row_upper", "quadratic", "price", "plausible"),
)
"""What a controller is made of, see :class:`Design`, in the order in which :func:`design_function` gives it."""


def design_function(mpc: "LinearMPC", order: int) -> ca.Function:
    """CasADi Function (A, B, C, D) -> NUMBERS and the largest relative residual of the Riccati equations.

    B and D have the manipulated inputs, in newtons, before the measured disturbances.
    """
    n, m, k, p = order, mpc.inputs, mpc.measured_disturbances, mpc.outputs
    A, B_all = ca.MX.sym("A", n, n), ca.MX.sym("B", n, m + k)  # pyright: ignore
    C, D_all = ca.MX.sym("C", p, n), ca.MX.sym("D", p, m + k)  # pyright: ignore
    (B, E), (D, F) = (ca.horzsplit(matrix, [0, m, m + k]) for matrix in (B_all, D_all))
    scale = ca.diag(ca.DM(mpc.input_scale))
    newtons = System(A, B, E, C, D, F)
    model = newtons._replace(B=B @ scale, D=D @ scale)
    rest, disturbance = at_rest(model, mpc.disturbance_model)

    # The inputs on their way are known, so that the filter is that of the model without them.
    gain, observer_residual = kalman_gain(disturbed(newtons, *disturbance), mpc.noise)
    observed = disturbed(queued(model, mpc.delay) if mpc.delay else model, *disturbance)
    queue = observed.A.shape[0] - n - p
    gain = ca.vertcat(gain[:n, :], ca.MX(queue, p), gain[n:, :])
    state_at_rest = ca.vertcat(rest.state_v, ca.repmat(ca.MX.eye(m), queue // m, 1), ca.MX(p, m))

    rows_seen = mpc.reference_rows
    parameters = Parameters(observed.A.shape[0], m, rows_seen * p, k)
    hold, preview = held(mpc.blocks, m), previewed(rows_seen, mpc.horizon, p)
    # What is measured of the disturbances is taken to stay, as a state that nothing moves.
    prediction = predict(
        ca.vertcat(ca.horzcat(observed.A, observed.E), ca.horzcat(ca.MX(k, parameters.state), ca.MX.eye(k))),
        ca.vertcat(observed.B, ca.MX(k, m)),
        ca.horzcat(observed.C, observed.F),
        observed.D,
        mpc.horizon,
    )

    stage, start, slope = _stage_cost(mpc, rest.output_v)
    terms = horizon_terms(stage, parameters, prediction, hold, changes(mpc.horizon, m), preview)
    moves = hold.shape[1]
    tilt, residual = ca.MX(moves, parameters.size), observer_residual
    if mpc.terminal == "riccati":
        target = steady_state(parameters, rest, start, slope)
        beyond = cost_to_go(model, mpc.delay, stage)
        forced, free = last_deviation(parameters, prediction, hold, target, mpc.delay)
        terms.append(Term(forced, free, beyond.weight))
        tilt = 2 * (beyond.slope @ forced).T @ target.miss
        residual = ca.fmax(residual, beyond.residual)
    hessian: ca.MX = 2 * sum((t.forced.T @ t.weight @ t.forced for t in terms), ca.MX(moves, moves))  # pyright: ignore
    gradient = 2 * sum((t.forced.T @ t.weight @ t.free for t in terms), ca.MX(moves, parameters.size)) + tilt

    bounds = constraint_rows(mpc, parameters, prediction, hold)
    rows, row_free = (ca.vertcat(*[getattr(b, name) for b in bounds]) for name in ("rows", "free"))
    constants = (
        ca.DM(np.concatenate([getattr(b, name) for b in bounds])) for name in ("lower", "upper", "quadratic", "price")
    )
    numbers = [
        *(*observed, gain, state_at_rest),
        *((hessian + hessian.T) / 2, gradient, rows, row_free),
        *(*constants, mpc.plausible_output),
    ]
    return ca.Function(
        "design",
        [A, B_all, C, D_all],
        [ca.densify(ca.MX(value)) for value in (*numbers, residual)],
        ["model_A", "model_B", "model_C", "model_D"],
        [*NUMBERS, "residual"],
    )


def _stage_cost(mpc: "LinearMPC", gain: ca.MX) -> tuple[StageCost, ca.MX, ca.MX]:
    """Weights of a sample, and the steady target ``start + slope (r - d)``: start and slope."""
    m = mpc.inputs
    Q, none = ca.MX(weight_matrix(mpc.Q, mpc.outputs, "Q")), ca.MX(m, m)
    R, centre = ca.MX(weight_matrix(mpc.R, m, "R")), middle(mpc.input_limits, mpc.input_scale)
    change = ca.MX(weight_matrix(mpc.rate_weight, m, "rate_weight"))
    if mpc.input_term == "rate":
        start, slope = steady_target(gain, Q, none, centre)
        return StageCost(Q, none, idle_weight(R, slope, gain), change + R, centre), start, slope
    if mpc.input_term == "literal":
        scale = ca.diag(ca.DM(mpc.input_scale))
        R = scale @ R @ scale
    start, slope = steady_target(gain, Q, R, centre)
    return StageCost(Q, R, none, change, centre), start, slope
