from typing import TYPE_CHECKING

import casadi as ca
import numpy as np

from .formulation import Design
from .solvers import CONIC, KKT_TOLERANCE, Shape, below, finite, kkt_residual, qp_solver

if TYPE_CHECKING:
    from ._spec import LinearMPC


def control_law(mpc: "LinearMPC", design: Design, *, backend: str = CONIC[0], with_qp: bool = True) -> ca.Function:
    """One sample of the controller as a CasADi Function: the same, step by step, as ``mpc_step`` in C.

    ``(y, reference, w, state) -> (u, state, status, residual, refused)`` with y (p,) m measured now, reference (P p,)
    m row after row, w (k,) measured disturbances, state = (x, v, w) after the last sample, x the observer's; u (m,) N
    inside its bounds and its rate bounds, status 0 for the QP's answer, 1 for the clipped unconstrained law, 2 for the
    held input, the KKT residual, and refused 1 when y was not used.

    The state is predicted with the input that was applied and corrected by y; a y that cannot be (not a number, or
    beyond ``design.plausible``) corrects nothing, and an observer that expects such a y starts anew from rest. A w
    that is not finite is taken to be the one before. An answer of the QP is believed when its KKT residual is at most
    1e-6. Else the unconstrained law is applied, clipped to the bounds, and when that or the reference is not finite,
    the input before. With ``with_qp=False`` the QP is left out: this Function takes over where the solver gives up.
    """
    ne, m, p, k = design.order, design.inputs, design.outputs, design.disturbances
    sizes = {"y": p, "reference": design.preview * p, "w": k, "state": ne + m + k}
    y, reference, w, state = (ca.MX.sym(name, size) for name, size in sizes.items())  # pyright: ignore
    before, v_before, w_before = ca.vertsplit(state, [0, ne, ne + m, ne + m + k])

    x, refused = _observe(design, before, v_before, w_before, y)
    w_now = ca.vertcat(*[ca.if_else(finite(w[i]), w[i], w_before[i]) for i in range(k)]) if k else w
    lowest, highest = (bound / mpc.input_scale for bound in mpc.input_limits)
    v_held = _clip(v_before, lowest, highest)
    parameters = ca.vertcat(x, v_held, reference, w_now, 1)

    law: ca.MX = ca.DM(design.law) @ parameters
    gradient, free = ca.DM(design.gradient) @ parameters, ca.DM(design.row_free) @ parameters
    # Clipping drops a NaN, so these are looked at before it hides one.
    lawful = finite(ca.vertcat(reference, law))
    v, status, residual = ca.if_else(lawful, law, v_held), ca.if_else(lawful, 1, 2), ca.MX(ca.inf)
    if with_qp:
        # A solver may raise at what is not finite; nothing is asked of it then.
        solvable = ca.logic_and(lawful, finite(ca.vertcat(gradient, free)))
        gradient, free = (ca.if_else(solvable, values, ca.DM.zeros(values.shape[0])) for values in (gradient, free))
        shape = Shape(design.hessian, design.rows, design.quadratic, design.price)
        bounds = gradient, ca.DM(design.row_lower) - free, ca.DM(design.row_upper) - free
        z, multipliers = qp_solver(backend, shape)(*bounds)
        residual = ca.if_else(solvable, kkt_residual(shape)(*bounds, z, multipliers), ca.inf)
        believed = residual <= KKT_TOLERANCE
        v, status = ca.if_else(believed, z[:m], v), ca.if_else(believed, 0, status)

    u = v * mpc.input_scale
    if mpc.rate_limits is not None:
        u_held = _clip(v_held * mpc.input_scale, *mpc.input_limits)
        slowest, fastest = (limit * mpc.sample_time for limit in mpc.rate_limits)
        u = _clip(u, u_held + slowest, u_held + fastest)
    u = _clip(u, *mpc.input_limits)
    return ca.Function(
        "law" if with_qp else "law_without_qp",
        [y, reference, w, state],
        [u, ca.vertcat(x, u / mpc.input_scale, w_now), status, residual, refused],
        list(sizes),
        ["u", "next_state", "status", "residual", "refused"],
    )


def rest_state(mpc: "LinearMPC", design: Design, u: np.ndarray) -> np.ndarray:
    """Controller state of a robot that rests under the tensions ``u``, undisturbed as far as is known."""
    v = u / mpc.input_scale
    return np.concatenate([design.rest @ v, v, np.zeros(design.disturbances)])


def _observe(design: Design, x: ca.MX, v: ca.MX, w: ca.MX, y: ca.MX) -> tuple[ca.MX, ca.MX]:
    """The observer's state now, and 1 when y was not used."""
    A, B, E, C, D, F, gain = (ca.DM(getattr(design, name)) for name in ("A", "B", "E", "C", "D", "F", "gain"))
    predicted = A @ x + B @ v + E @ w
    direct = D @ v + F @ w
    sane = ca.logic_and(finite(predicted), below(C @ predicted + direct, design.plausible))
    predicted = ca.if_else(sane, predicted, ca.DM(design.rest) @ v)
    plausible = below(y, design.plausible)
    innovation = ca.if_else(plausible, y - (C @ predicted + direct), ca.DM.zeros(design.outputs))
    return predicted + gain @ innovation, ca.logic_not(plausible)


def _clip(values: ca.MX, lower: ca.MX | np.ndarray, upper: ca.MX | np.ndarray) -> ca.MX:
    return ca.fmin(ca.fmax(values, lower), upper)
