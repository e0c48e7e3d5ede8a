"""From a prediction model to the numbers of its controller: one CasADi expression, so differentiable in the model."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Self

import casadi as ca
import numpy as np

from ._condense import predict
from ._observer import kalman_gain
from ._riccati import riccati
from ._target import steady_target
from ._weights import weight_matrix

if TYPE_CHECKING:
    from ._spec import LinearMPC


class DesignError(ValueError):
    """A prediction model from which no controller can be made."""


@dataclass(frozen=True, eq=False)
class Design:
    r"""Numbers of one controller. Inputs are scaled, :math:`v = u / u_{max}`.

    The QP is min z'Hz/2 + (g p)'z with rows z <= b p, over z = (v_0 ... v_{N-1}, slacks of y_1 ... y_N as shares of the
    largest output bound), where p = (x, d, v_{-1}, r_1 ... r_N, 1). Everything online is affine in p.
    """

    A: np.ndarray
    B: np.ndarray
    C: np.ndarray
    D: np.ndarray
    rest: np.ndarray
    """(n, m) state in which the model rests under a constant v."""
    state_gain: np.ndarray
    """(n, p) Kalman gain of the state."""
    disturbance_gain: np.ndarray
    """(p, p) Kalman gain of the output disturbance."""
    hessian: np.ndarray
    gradient: np.ndarray
    rows: np.ndarray
    row_bounds: np.ndarray
    law: np.ndarray
    """(m, len(p)) first input of the unconstrained problem."""

    @classmethod
    def checked(cls, numbers: Sequence[ca.DM]) -> Self:
        """The design of evaluated outputs of :func:`design_function`; DesignError when it is none."""
        *arrays, residual, observer = (np.asarray(value.full()) for value in numbers)
        design = cls(*arrays)
        if not all(np.isfinite(array).all() for array in (*arrays, residual)):
            raise DesignError(
                "the model gives no controller: a steady state, a gain or the terminal cost is not finite"
            )
        if residual.item() > 1e-6:
            raise DesignError(
                f"the model gives no controller: a Riccati equation is left with a residual of {residual.item():.1e} "
                "(the model cannot be stabilised or observed)"
            )
        radius = np.abs(np.linalg.eigvals(observer)).max()
        if radius >= 1:
            raise DesignError(f"the model gives no controller: its observer has a pole of magnitude {radius:.4f}")
        if np.linalg.eigvalsh(design.hessian)[0] <= 0:
            raise DesignError("the model gives no controller: the QP is not strictly convex")
        return design


def design_function(mpc: "LinearMPC", order: int) -> ca.Function:
    """CasADi Function (A, B, C, D) -> fields of :class:`Design`, a Riccati residual, the observer's error dynamics."""
    n, m, p, N = order, mpc.inputs, mpc.outputs, mpc.horizon
    A, C = ca.MX.sym("A", n, n), ca.MX.sym("C", p, n)  # pyright: ignore
    B_newton, D_newton = ca.MX.sym("B", n, m), ca.MX.sym("D", p, m)  # pyright: ignore
    scale = ca.diag(ca.DM(mpc.input_scale))
    B, D = B_newton @ scale, D_newton @ scale
    Q = ca.MX(weight_matrix(mpc.Q, p, "Q"))
    on_input, on_rate = _input_weights(mpc)

    rest = ca.solve(ca.MX.eye(n) - A, B)
    lower, upper = (limit / mpc.input_scale for limit in mpc.input_limits)
    v_0, v_reference = steady_target(C @ rest + D, Q, on_input, ca.DM((lower + upper) / 2))
    noise = ca.DM.ones(p) * mpc.measurement_noise
    state_gain, disturbance_gain = kalman_gain(A, B_newton, C, mpc.input_noise, mpc.disturbance_noise, noise)
    extended = ca.diagcat(A, ca.MX.eye(p))
    error_dynamics = extended - ca.vertcat(state_gain, disturbance_gain) @ ca.horzcat(C, ca.MX.eye(p)) @ extended

    # Blocks of p = (x, d, v_{-1}, r_1 ... r_N, 1): each linear map below is written as one row of such blocks.
    widths = {"x": n, "d": p, "v": m, "r": N * p, "one": 1}

    def maps(rows: int, **blocks: ca.MX) -> ca.MX:
        return ca.horzcat(*[blocks.get(name, ca.MX(rows, width)) for name, width in widths.items()])

    prediction = predict(A, B, C, D, N)
    repeated_d = ca.repmat(ca.MX.eye(p), N, 1)
    difference = _difference(N, m)
    first = ca.vertcat(ca.MX.eye(m), ca.MX((N - 1) * m, m))
    last = ca.horzcat(ca.MX(m, (N - 1) * m), ca.MX.eye(m))

    # Each term of the cost is |linear in V + linear in p|^2 with a weight: (forced, free, weight).
    terms = [
        (
            prediction.output_forced,
            maps(N * p, x=prediction.output_free, d=repeated_d, r=-ca.MX.eye(N * p)),
            ca.kron(ca.DM.eye(N), Q),
        ),
        (difference, maps(N * m, v=-first), ca.kron(ca.DM.eye(N), on_rate)),
        (ca.MX.eye(N * m), maps(N * m), ca.kron(ca.DM.eye(N), on_input)),
    ]
    residual, price = ca.MX(0), ca.MX(n, sum(widths.values()))
    if mpc.terminal == "riccati":
        cost_to_go, residual = _cost_to_go(A, B, C, D, Q, on_input, on_rate)
        newest = ca.horzcat(ca.MX(p, (N - 1) * p), ca.MX.eye(p))
        target_r, target_d, target_1 = v_reference @ newest, -v_reference, v_0
        free = ca.vertcat(
            maps(n, x=prediction.last_free, d=-rest @ target_d, r=-rest @ target_r, one=-rest @ target_1),
            maps(m, d=-target_d, r=-target_r, one=-target_1),
        )
        terms.append((ca.vertcat(prediction.last_forced, last), free, cost_to_go))
        off_target = (C @ rest + D) @ maps(m, d=target_d, r=target_r, one=target_1) + maps(p, d=ca.MX.eye(p), r=-newest)
        price = ca.solve(ca.MX.eye(n) - A.T, C.T @ Q @ off_target)

    hessian = 2 * sum((forced.T @ weight @ forced for forced, _, weight in terms), ca.MX(N * m, N * m))
    gradient = 2 * sum(
        (forced.T @ weight @ free for forced, free, weight in terms),
        # Where the target is off the reference, as a weight on the input itself makes it, the cost-to-go has a slope.
        prediction.last_forced.T @ A.T @ price,
    )
    law = -ca.solve(hessian, gradient)[:m, :]
    rows, row_bounds = ca.MX(0, N * m), ca.MX(0, sum(widths.values()))
    if mpc.output_limits is not None:
        y_lower, y_upper = (ca.repmat(ca.DM(limit), N, 1) for limit in mpc.output_limits)
        largest = float(np.max(np.abs(mpc.output_limits)))
        slack = -ca.MX.eye(N * p)
        forced, free = (
            prediction.output_forced / largest,
            maps(N * p, x=prediction.output_free, d=repeated_d) / largest,
        )
        rows = ca.vertcat(ca.horzcat(forced, slack), ca.horzcat(-forced, slack))
        row_bounds = ca.vertcat(
            maps(N * p, one=ca.MX(y_upper / largest)) - free,
            free - maps(N * p, one=ca.MX(y_lower / largest)),
        )
        hessian = ca.diagcat(hessian, 2 * mpc.slack_weight * largest**2 * ca.MX.eye(N * p))
        gradient = ca.vertcat(gradient, ca.MX(N * p, sum(widths.values())))

    outputs = [A, B, C, D, rest, state_gain, disturbance_gain, hessian, gradient, rows, row_bounds, law]
    return ca.Function(
        "design",
        [A, B_newton, C, D_newton],
        [ca.densify(o) for o in (*outputs, residual, error_dynamics)],
    )


def _input_weights(mpc: "LinearMPC") -> tuple[ca.MX, ca.MX]:
    """Weights (m, m) of v and of its change from sample to sample."""
    weight, none = ca.MX(weight_matrix(mpc.R, mpc.inputs, "R")), ca.MX(mpc.inputs, mpc.inputs)
    match mpc.input_term:
        case "rate":
            return none, weight
        case "normalised":
            return weight, none
        case "literal":
            scale = ca.diag(ca.DM(mpc.input_scale))
            return scale @ weight @ scale, none


def _difference(horizon: int, inputs: int) -> ca.MX:
    """Maps (v_0 ... v_{N-1}) to the changes between them; the first lacks its -v_{-1}."""
    one_back = np.eye(horizon, k=-1)
    return ca.MX(ca.DM(np.kron(np.eye(horizon) - one_back, np.eye(inputs))))


def _cost_to_go(
    A: ca.MX,
    B: ca.MX,
    C: ca.MX,
    D: ca.MX,
    Q: ca.MX,
    on_input: ca.MX,
    on_rate: ca.MX,
) -> tuple[ca.MX, ca.MX]:
    """Weight of (x_N - x_s, v_{N-1} - v_s) beyond the horizon, and the relative residual of its Riccati equation.

    The state is the model's with the last input beside it, since that decides both the output y_N (through D) and the
    first change of the input. What y_N itself costs is already in the horizon's sum and is taken off.
    """
    n, m = B.shape
    state = ca.diagcat(A, ca.MX(m, m))
    entry = ca.vertcat(B, ca.MX.eye(m))
    output = ca.horzcat(C, D)
    stage = output.T @ Q @ output
    before = ca.horzcat(ca.MX(m, n), ca.MX.eye(m))
    weight_state, weight_input, cross = (
        stage + before.T @ on_rate @ before,
        on_input + on_rate,
        -before.T @ on_rate,
    )
    P = riccati(state, entry, weight_state, weight_input, cross)
    mixed = state.T @ P @ entry + cross
    left = state.T @ P @ state + weight_state - mixed @ ca.solve(entry.T @ P @ entry + weight_input, mixed.T) - P
    return P - stage, ca.norm_inf(ca.vec(left)) / ca.norm_inf(ca.vec(P))
