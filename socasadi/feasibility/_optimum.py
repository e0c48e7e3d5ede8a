"""What the cost itself asks for: the flight of least J, by one who knows all that comes."""

from dataclasses import dataclass

import numpy as np

from ..campaign import Cost
from ..model import StateSpace
from ..mpc import weight_matrix


@dataclass(frozen=True, eq=False)
class Optimum:
    """The flight of least J.

    Attributes
    ----------
    J
        Its cost.
    output
        (T, p) at the end of each sample.
    input
        (T, m).
    """

    J: float
    output: np.ndarray
    input: np.ndarray


def optimum(
    system: StateSpace,
    reference: np.ndarray,
    cost: Cost,
    scale: np.ndarray,
    start: np.ndarray,
    rest: np.ndarray,
) -> Optimum:
    r"""The inputs of least J on a linear robot without bounds, noise or doubt, the whole reference known.

    With the state :math:`z_t = (x_t, v_{t-1})`, v the inputs in shares of ``scale``, dynamic programming over
    :math:`V_t(z) = z'P_tz + 2 p_t'z + c_t` gives the inputs backwards in time (Bertsekas 2017, section 3.1).

    Parameters
    ----------
    system
        x+ = A x + B u, y = C x + D u in deviations from the pose in which it was linearised.
    reference
        (T, p) wanted at the end of each sample, in the same deviations.
    scale
        u_max (m,), N.
    start
        Inputs (m,) under which it rests at first, as deviations.
    rest
        Inputs (m,) in that pose, N.
    """
    (A, B, C, D), n, m = system, len(system.A), len(scale)
    B, D = B * scale, D * scale
    Q = weight_matrix(cost.Q, len(C), "Q of the cost")
    R = weight_matrix(cost.R, m, "R of the cost")
    if cost.input_term == "literal":
        R = R * np.outer(scale, scale)
    rated, held = cost.input_term == "rate", rest / scale
    F = np.block([[A, np.zeros((n, m))], [np.zeros((m, n + m))]])
    G = np.vstack([B, np.eye(m)])
    # y at the end of the sample, and what R weighs, both linear in z and v.
    Yz, Yv = np.hstack([C @ A, np.zeros((len(C), m))]), C @ B + D
    Wz, offset = (np.hstack([np.zeros((m, n)), -np.eye(m)]), 0 * held) if rated else (np.zeros((m, n + m)), held)
    Hzz, Hvz, Hvv = Yz.T @ Q @ Yz + Wz.T @ R @ Wz, Yv.T @ Q @ Yz + R @ Wz, Yv.T @ Q @ Yv + R
    P, p, laws = np.zeros((n + m, n + m)), np.zeros(n + m), []
    for wanted in reference[::-1]:
        hz = -Yz.T @ Q @ wanted + Wz.T @ R @ offset + F.T @ p
        hv = -Yv.T @ Q @ wanted + R @ offset + G.T @ p
        vz, vv = Hvz + G.T @ P @ F, Hvv + G.T @ P @ G
        K, k = np.linalg.solve(vv, vz), np.linalg.solve(vv, hv)
        laws.append((K, k))
        P, p = Hzz + F.T @ P @ F - vz.T @ K, hz - vz.T @ k
        P = (P + P.T) / 2
    v = start / scale
    x = np.linalg.lstsq(np.eye(n) - A, B @ v, rcond=None)[0]
    J, outputs, inputs = 0.0, [], []
    for (K, k), wanted in zip(reversed(laws), reference, strict=True):
        before, v = v, -K @ np.concatenate([x, v]) - k
        x = A @ x + B @ v
        y = C @ x + D @ v
        weighed = v - before if rated else v + held
        J += float((y - wanted) @ Q @ (y - wanted) + weighed @ R @ weighed)
        outputs.append(y)
        inputs.append(v * scale + rest)
    return Optimum(J, np.array(outputs), np.array(inputs))
