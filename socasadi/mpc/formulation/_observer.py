from typing import NamedTuple

import casadi as ca
import numpy as np

from ._augment import System
from ._riccati import riccati, riccati_residual


class Noise(NamedTuple):
    """Covariances that the Kalman filter assumes."""

    input: np.ndarray
    """(m, m) of an unknown input, in the unit of the system's B."""
    disturbance: np.ndarray
    """(p, p) of the step that the disturbance takes in a sample, m2."""
    measurement: np.ndarray
    """(p, p) of the sensor, m2."""


def kalman_gain(system: System, noise: Noise) -> tuple[ca.MX, ca.MX]:
    r"""Steady Kalman gain (order, p), and the relative residual of its Riccati equation.

    The last p states of ``system`` are disturbances that wander as random walks (Pannocchia and Rawlings,
    "Disturbance models for offset-free model-predictive control", AIChE J. 49, 2003); B has no rows for them that are
    not zero. With n the unknown input, :math:`\xi` the disturbance's step and e the sensor's noise,

    .. math:: x_k = A x_{k-1} + B (u + n_k) + (0, \xi_k), \qquad y_k = C x_k + D (u + n_k) + e_k .

    As many disturbances as outputs make the controller free of offset: at rest the estimate reproduces the measured
    outputs whatever the errors of A, B, C and D.

    Since :math:`n_k` reaches both :math:`x_k` and :math:`y_k`, the noises of process and output are correlated. With
    :math:`n_k` as a state beside :math:`x_k` they are not, and the filter is the usual one for that larger system;
    the rows of its gain that belong to x are returned. (The other way, a Riccati equation with a cross term, is the
    same filter, but it loses the sensor's noise in rounding where that is small.)
    """
    (order, m), p = system.B.shape, system.C.shape[0]
    # Outputs are counted in the sensor's noise, so that nothing here depends on their unit.
    white = ca.DM(np.linalg.inv(np.linalg.cholesky(noise.measurement)))
    transition = ca.diagcat(system.A, ca.MX(m, m))
    output = white @ ca.horzcat(system.C, system.D)
    entry = ca.vertcat(system.B, ca.MX.eye(m))
    walk = ca.DM(noise.disturbance)
    process = entry @ ca.DM(noise.input) @ entry.T + ca.diagcat(ca.MX(order - p, order - p), walk, ca.MX(m, m))
    equation = (transition.T, output.T, process, ca.MX.eye(p))
    covariance = riccati(*equation)
    innovation = output @ covariance @ output.T + ca.MX.eye(p)
    gain = ca.solve(innovation, output @ covariance).T @ white
    return gain[:order, :], riccati_residual(covariance, *equation)
