import casadi as ca

_CENTRING = 1e-8


def steady_target(gain: ca.MX, Q: ca.MX, R: ca.MX, centre: ca.DM) -> tuple[ca.MX, ca.MX]:
    r"""The input at which the stage cost is least at rest, as ``v = v_0 + T (r - d)``: v_0 (m,) and T (m, p).

    .. math:: v = \arg\min_v |G v + d - r|^2_Q + |v|^2_R + \epsilon |v - v_c|^2

    G is the static gain, d the output disturbance, r the reference. Without a weight R on the input itself the outputs
    reach the reference, and the last term, too small to be felt otherwise, chooses among the inputs that do:
    the ones nearest to the middle :math:`v_c` of the input bounds.
    """
    weighted = gain.T @ Q
    hessian = weighted @ gain + R
    # Relative to the best seen direction, so that a direction that the inputs hardly move is left alone.
    small = _CENTRING * ca.trace(hessian) / gain.shape[1]
    solved = ca.solve(hessian + small * ca.MX.eye(gain.shape[1]), ca.horzcat(weighted, small * centre))
    return solved[:, -1], solved[:, :-1]
