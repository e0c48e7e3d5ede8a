from typing import TYPE_CHECKING

import casadi as ca
import numpy as np

from ._design import Design
from ._qp import KKT_TOLERANCE, below, finite, kkt_residual, qp_solver

if TYPE_CHECKING:
    from ._spec import LinearMPC


# No tip is there, m; a spike beyond would blind the observer for as long as it takes to decay.
_FARTHEST = 1e3


def control_law(mpc: "LinearMPC", design: Design, *, with_qp: bool = True) -> ca.Function:
    """One sample of the controller as a CasADi Function: what is interpreted, and what C is generated from.

    ``(y, reference, state) -> (u, state, status, residual)`` with y (p,) m measured now, reference (N p,) m row after
    row, state = (x, d, v) after the last sample, u (m,) N inside its bounds, status 0 for the QP's answer, 1 for the
    clipped unconstrained law, 2 for the held input, and the KKT residual.

    The state is predicted with the input that was applied and corrected by y; a y that cannot be (not a number, or a
    kilometre and more) corrects nothing. An answer of the QP is believed when its KKT residual is at most 1e-6. Else
    the unconstrained law is applied, clipped to the bounds, and when that is not finite either, the input before. With
    ``with_qp=False`` the QP is left out: this Function takes over where the solver itself gives up.
    """
    n, m, p, N = len(design.A), mpc.inputs, mpc.outputs, mpc.horizon
    y, reference = ca.MX.sym("y", p), ca.MX.sym("reference", N * p)  # pyright: ignore
    state = ca.MX.sym("state", n + p + m)  # pyright: ignore
    x, d, v_before = ca.vertsplit(state, [0, n, n + p, n + p + m])
    lower, upper = (limit / mpc.input_scale for limit in mpc.input_limits)

    x = design.A @ x + design.B @ v_before
    innovation = y - (design.C @ x + design.D @ v_before + d)
    innovation = ca.if_else(below(y, _FARTHEST), innovation, ca.DM.zeros(p))
    x, d = x + design.state_gain @ innovation, d + design.disturbance_gain @ innovation
    parameters = ca.vertcat(x, d, v_before, reference, 1)

    law: ca.MX = ca.DM(design.law) @ parameters
    held = ca.fmin(ca.fmax(v_before, lower), upper)
    # fmin and fmax drop a NaN, so the law is looked at before they hide it.
    lawful = finite(law)
    v = ca.if_else(lawful, ca.fmin(ca.fmax(law, lower), upper), held)
    status = ca.if_else(lawful, 1, 2)
    residual = ca.MX(ca.inf)
    if with_qp:
        answer, residual = _solve(mpc, design, parameters, lower, upper)
        believed = residual <= KKT_TOLERANCE
        v = ca.if_else(believed, ca.fmin(ca.fmax(answer[:m], lower), upper), v)
        status = ca.if_else(believed, 0, status)
    # Scaling back can round across a bound.
    u = ca.fmin(ca.fmax(v * mpc.input_scale, mpc.input_limits[0]), mpc.input_limits[1])
    return ca.Function(
        "law" if with_qp else "law_without_qp",
        [y, reference, state],
        [u, ca.vertcat(x, d, v), status, residual],
        ["y", "reference", "state"],
        ["u", "next_state", "status", "residual"],
    )


def rest_state(mpc: "LinearMPC", design: Design, u: np.ndarray) -> np.ndarray:
    """Controller state of a robot that rests under the tensions ``u``, undisturbed as far as is known."""
    v = u / mpc.input_scale
    return np.concatenate([design.rest @ v, np.zeros(mpc.outputs), v])


def _solve(
    mpc: "LinearMPC", design: Design, parameters: ca.MX, lower: np.ndarray, upper: np.ndarray
) -> tuple[ca.MX, ca.MX]:
    H, A = ca.MX(ca.DM(design.hessian)), ca.MX(ca.DM(design.rows))
    g, row_bounds = ca.DM(design.gradient) @ parameters, ca.DM(design.row_bounds) @ parameters
    slacks = len(design.hessian) - mpc.horizon * mpc.inputs
    lbx = ca.DM(np.concatenate([np.tile(lower, mpc.horizon), np.zeros(slacks)]))
    ubx = ca.DM(np.concatenate([np.tile(upper, mpc.horizon), np.full(slacks, np.inf)]))
    solver = qp_solver(mpc.backend, len(design.hessian), len(design.rows))
    answer = solver(h=H, g=g, a=A, lba=-np.inf, uba=row_bounds, lbx=lbx, ubx=ubx)
    residual = kkt_residual(H, g, A, row_bounds, lbx, ubx, answer["x"], answer["lam_x"], answer["lam_a"])
    return answer["x"], residual
