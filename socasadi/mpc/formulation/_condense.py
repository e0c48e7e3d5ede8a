from typing import NamedTuple

import casadi as ca


class Prediction(NamedTuple):
    """Outputs and last state as linear maps of the first state and the inputs (see :func:`predict`)."""

    output_free: ca.MX
    output_forced: ca.MX
    last_free: ca.MX
    last_forced: ca.MX


def predict(A: ca.MX, B: ca.MX, C: ca.MX, D: ca.MX, horizon: int) -> Prediction:
    r"""The horizon's outputs without its states ("condensing").

    With :math:`x_{k+1} = A x_k + B v_k` and :math:`y_{k+1} = C x_{k+1} + D v_k`, the stacks
    :math:`Y = (y_1, ..., y_N)` and :math:`V = (v_0, ..., v_{N-1})` obey

    .. math:: Y = \Phi x_0 + \Gamma V, \qquad x_N = A^N x_0 + \Lambda V,

    where block row k of :math:`\Phi` is :math:`C A^k`, and block (k, j) of :math:`\Gamma` is
    :math:`C A^{k-1-j} B` for j < k, plus D on the diagonal j = k - 1.
    """
    powers, forced = [ca.MX.eye(A.shape[0])], [B]
    for _ in range(horizon):
        powers.append(A @ powers[-1])
        forced.append(A @ forced[-1])
    forced.pop()
    markov = [C @ block for block in forced]
    markov[0] += D
    zero = ca.MX(C.shape[0], B.shape[1])
    rows = [ca.horzcat(*[markov[k - 1 - j] if j < k else zero for j in range(horizon)]) for k in range(1, horizon + 1)]
    return Prediction(
        output_free=ca.vertcat(*[C @ power for power in powers[1:]]),
        output_forced=ca.vertcat(*rows),
        last_free=powers[-1],
        last_forced=ca.horzcat(*reversed(forced)),
    )
