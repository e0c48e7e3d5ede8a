"""Acquisition functions of the posterior's mean and standard deviation, with exact partial derivatives."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.special import erfcx, ndtr

from ._named import choose

_LOG_SQRT_2PI = 0.5 * np.log(2.0 * np.pi)
# Below this z, 1 + z m(z) loses more to cancellation (z^2 eps) than its asymptotic series to truncation.
_SERIES = -60.0


class Acquisition(Protocol):
    """A function to maximise, for minimisation of the cost."""

    def __call__(self, mean: NDArray, std: NDArray, best: float) -> tuple[NDArray, NDArray, NDArray]:
        """Return the value and its derivatives with respect to mean and std, all of the shape of `mean`."""
        ...


def expected_improvement(mean: NDArray, std: NDArray, best: float) -> tuple[NDArray, NDArray, NDArray]:
    """EI = E[max(J* - f, 0)] and its partial derivatives.

    EI = (J* - mean) Phi(z) + std phi(z), z = (J* - mean)/std:
    Jones, Schonlau and Welch 1998, eq. 15. dEI/dmean = -Phi(z), dEI/dstd = phi(z).

    Parameters
    ----------
    mean, std : ndarray, same shape
    best : float
        J*, the best value so far, on the same scale.
    """
    z = (best - mean) / std
    phi, Phi = np.exp(-0.5 * z * z - _LOG_SQRT_2PI), ndtr(z)
    # Far below zero the two terms cancel to rounding error of either sign.
    return np.maximum((best - mean) * Phi + std * phi, 0.0), -Phi, phi


def log_expected_improvement(mean: NDArray, std: NDArray, best: float) -> tuple[NDArray, NDArray, NDArray]:
    """log EI and its partial derivatives, accurate where EI itself underflows.

    EI = std phi(z) q with q = 1 + z m and m = Phi(z)/phi(z) (the reciprocal of the inverse Mills ratio). For
    negative z, m comes from the scaled complementary error function and, far out, q from the asymptotic
    series of 1 + z m in 1/z^2. The purpose and the problem: Ament et al. 2023, arXiv 2310.20708.

    Parameters and shapes as for `expected_improvement`.
    """
    mean, std = np.asarray(mean, dtype=float), np.asarray(std, dtype=float)
    z = (best - mean) / std
    negative = np.minimum(z, 0.0)
    m = np.sqrt(0.5 * np.pi) * erfcx(-negative / np.sqrt(2.0))
    w = 1.0 / np.square(np.minimum(z, _SERIES))
    q = np.where(z < _SERIES, w * (1 - w * (3 - w * (15 - w * (105 - w * 945)))), 1.0 + negative * m)
    log_value = np.log(std) - 0.5 * negative * negative - _LOG_SQRT_2PI + np.log(q)
    d_mean, d_std = -m / (std * q), 1.0 / (std * q)

    # For positive z nothing is small, and m would overflow.
    value, value_mean, value_std = expected_improvement(mean, std, best)
    positive = z > 0
    value = np.where(positive, value, 1.0)
    return (
        np.where(positive, np.log(value), log_value),
        np.where(positive, value_mean / value, d_mean),
        np.where(positive, value_std / value, d_std),
    )


ACQUISITIONS: dict[str, Acquisition] = {"log_ei": log_expected_improvement, "ei": expected_improvement}


def acquisition_named(name: str) -> Acquisition:
    """Return the acquisition of that name; ValueError lists the known ones."""
    return choose("acquisition", ACQUISITIONS, name)
