import casadi as ca

_DOUBLINGS = 18


def riccati(A: ca.MX, B: ca.MX, Q: ca.MX, R: ca.MX, S: ca.MX | None = None) -> ca.MX:
    r"""Solution P of the discrete algebraic Riccati equation, as an expression in its coefficients.

    .. math:: P = A'PA + Q - (A'PB + S)(B'PB + R)^{-1}(B'PA + S')

    Structure-preserving doubling (Chu, Fan, Lin, Wang, "Structure-preserving algorithms for periodic discrete-time
    algebraic Riccati equations", Int. J. Control 77, 2004): step k is the cost-to-go over :math:`2^k` samples from a
    zero terminal cost, so that the limit is the smallest positive semidefinite solution. A fixed number of steps covers
    2.6e5 samples. The expression is not checked here: where no solution exists the values grow, and the design that
    uses them is refused for its :func:`riccati_residual`.
    """
    if S is not None:
        A, Q = A - B @ ca.solve(R, S.T), Q - S @ ca.solve(R, S.T)
    identity = ca.DM.eye(A.shape[0])
    G, H = B @ ca.solve(R, B.T), Q
    for _ in range(_DOUBLINGS):
        # Both products with (I + G H)^-1 from one factorisation.
        solved = ca.solve(identity + G @ H, ca.horzcat(A, G))
        WA, WG = ca.horzsplit(solved, [0, A.shape[0], 2 * A.shape[0]])
        A, G, H = A @ WA, G + A @ WG @ A.T, H + A.T @ H @ WA
        G, H = (G + G.T) / 2, (H + H.T) / 2
    return H


def riccati_residual(P: ca.MX, A: ca.MX, B: ca.MX, Q: ca.MX, R: ca.MX, S: ca.MX | None = None) -> ca.MX:
    """What P leaves of its Riccati equation, relative to P: largest entry over largest entry."""
    mixed = A.T @ P @ B if S is None else A.T @ P @ B + S
    left = A.T @ P @ A + Q - mixed @ ca.solve(B.T @ P @ B + R, mixed.T) - P
    return ca.norm_inf(ca.vec(left)) / ca.norm_inf(ca.vec(P))
