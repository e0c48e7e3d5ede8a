from typing import NamedTuple

import casadi as ca
import numpy as np

from ._augment import System

_CENTRING = 1e-8
_PASSES = 3


def steady_target(gain: ca.MX, Q: ca.MX, R: ca.MX, centre: ca.DM) -> tuple[ca.MX, ca.MX]:
    r"""The input at which the stage cost is least at rest, as ``v = v_0 + T (r - d)``: v_0 (m,) and T (m, p).

    .. math:: v = \arg\min_v |G v + d - r|^2_Q + |v|^2_R

    G is the static gain, d the output disturbance, r the reference. Among inputs of equal cost, of which there are many
    without a weight R on the input itself, it is the one nearest to the middle :math:`v_c` of the input bounds. It is
    found by the proximal point method: a small weight draws v to :math:`v_c` at first, then to the v found last, so
    that the share :math:`\epsilon / (\lambda + \epsilon)` by which it misses in a direction of curvature
    :math:`\lambda` is raised to the number of passes (Rockafellar, "Monotone operators and the proximal point
    algorithm", SIAM J. Control Optim. 14, 1976).
    """
    m, p = gain.shape[1], gain.shape[0]
    weighted = gain.T @ Q
    hessian = weighted @ gain + R
    # Relative to the best seen direction, so that a direction that the inputs hardly move is left alone.
    size, small = ca.trace(hessian) / m, _CENTRING * ca.MX.eye(m)
    pull, stay = ca.horzsplit(ca.solve(hessian / size + small, ca.horzcat(weighted / size, small)), [0, p, p + m])
    start, slope = ca.MX(centre), ca.MX(m, p)
    for _ in range(_PASSES):
        start, slope = stay @ start, stay @ slope + pull
    return start, slope


def right_inverse(gain: ca.MX) -> ca.MX:
    """T (m, p) with G T = I as far as the inputs reach."""
    m, p = gain.shape[1], gain.shape[0]
    return steady_target(gain, ca.MX.eye(p), ca.MX(m, m), ca.DM.zeros(m))[1]


class Rest(NamedTuple):
    """States (n, .) and outputs (p, .) at rest under constant inputs v, measured disturbances w and disturbances d."""

    state_v: ca.MX
    state_w: ca.MX
    state_d: ca.MX
    output_v: ca.MX
    output_w: ca.MX
    output_d: ca.MX


class Disturbance(NamedTuple):
    """How d (p,), m, enters the model's states and its outputs."""

    on_state: ca.MX
    on_output: ca.MX


def at_rest(system: System, disturbance_model: str) -> tuple[Rest, Disturbance]:
    """The system's states at rest, and where its disturbances enter.

    ``"output"``: at the outputs. ``"input"``: at the inputs, through the right inverse of the static gain. Either
    way d is in metres and its effect on the outputs at rest is d.
    """
    n, m = system.B.shape
    p, k = system.C.shape[0], system.E.shape[1]
    settled = ca.solve(ca.MX.eye(n) - system.A, ca.horzcat(system.B, system.E))
    state_v, state_w = ca.horzsplit(settled, [0, m, m + k])
    output_v = system.C @ state_v + system.D
    if disturbance_model == "input":
        T = right_inverse(output_v)
        entry, state_d, output_d = Disturbance(system.B @ T, system.D @ T), state_v @ T, output_v @ T
    else:
        entry, state_d, output_d = Disturbance(ca.MX(n, p), ca.MX.eye(p)), ca.MX(n, p), ca.MX.eye(p)
    return Rest(state_v, state_w, state_d, output_v, system.C @ state_w + system.F, output_d), entry


def middle(limits: tuple[np.ndarray, np.ndarray], scale: np.ndarray) -> ca.DM:
    """Middle of the scaled input bounds (m,)."""
    return ca.DM((limits[0] + limits[1]) / (2 * scale))
