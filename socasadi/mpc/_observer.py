import casadi as ca

from ._riccati import riccati


def kalman_gain(
    A: ca.MX,
    B: ca.MX,
    C: ca.MX,
    input_noise: float,
    disturbance_noise: float,
    measurement_noise: ca.DM,
) -> tuple[ca.MX, ca.MX]:
    r"""Steady Kalman gains (n, p) of the state and (p, p) of the output disturbance.

    The model is extended by a disturbance d on the outputs that wanders as a random walk (Pannocchia and Rawlings,
    "Disturbance models for offset-free model-predictive control", AIChE J. 49, 2003):

    .. math:: x_+ = A x + B (u + w), \quad d_+ = d + \xi, \quad y = C x + D u + d + e .

    As many disturbances as outputs make the controller free of offset: at rest the estimate reproduces the measured
    outputs whatever the errors of A, B, C and D.

    Parameters
    ----------
    input_noise
        Standard deviation of w, in the unit of the input of B.
    disturbance_noise
        Standard deviation of the step of d in one sample, m.
    measurement_noise
        (p,) standard deviation of e, m.
    """
    n, p = A.shape[0], C.shape[0]
    extended = ca.diagcat(A, ca.MX.eye(p))
    output = ca.horzcat(C, ca.MX.eye(p))
    process = ca.diagcat(input_noise**2 * B @ B.T, disturbance_noise**2 * ca.MX.eye(p))
    measured = ca.MX(ca.diag(measurement_noise**2))
    covariance = riccati(extended.T, output.T, process, measured)
    gain = ca.solve(output @ covariance @ output.T + measured, output @ covariance).T
    return gain[:n, :], gain[n:, :]
