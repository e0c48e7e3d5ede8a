"""Acquisition functions of the posterior's mean and standard deviation, with exact partial derivatives."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import erfcx, expit, ndtr

from .._named import choose

_LOG_SQRT_2PI = 0.5 * np.log(2.0 * np.pi)
# Below this z, 1 + z m(z) loses more to cancellation (z^2 eps) than its asymptotic series to truncation.
_SERIES = -60.0

# Deviations below the mean, of the confidence bound.
_CONFIDENCE = 2.0

Partials = tuple[NDArray, NDArray, NDArray]


@dataclass(frozen=True)
class Acquisition:
    """A merit to maximise, for minimisation of the cost.

    Parameters
    ----------
    function : callable
        (mean, std, best) to the merit and its derivatives with respect to mean and std, all of one shape.
    logarithm : bool
        The merit is the logarithm of something positive.
    noisy : bool
        It is to be averaged over what the noise may have hidden at the points already told.
    alternating : bool
        At every other ask the best to improve on is the lowest cost believed at a told point, not the lowest observed.
        The lower of the two explores, the other refines what is there, and neither does better on all costs. Once noise
        was seen, the lowest observed is mostly luck, and its place is taken by the lowest that a told point may well
        have: what is believed of it less one deviation.
    """

    function: Callable[[NDArray, NDArray, NDArray | float], Partials]
    logarithm: bool = True
    noisy: bool = False
    alternating: bool = False


def expected_improvement(mean: NDArray, std: NDArray, best: NDArray | float) -> Partials:
    """EI = E[max(J* - f, 0)] and its partial derivatives.

    EI = (J* - mean) Phi(z) + std phi(z), z = (J* - mean)/std:
    Jones, Schonlau and Welch 1998, eq. 15. dEI/dmean = -Phi(z), dEI/dstd = phi(z).

    Parameters
    ----------
    mean, std : ndarray
        Of shapes that broadcast.
    best : float or ndarray
        J*, the best value so far, on the same scale.
    """
    z = (best - mean) / std
    phi, Phi = np.exp(-0.5 * z * z - _LOG_SQRT_2PI), ndtr(z)
    # Far below zero the two terms cancel to rounding error of either sign.
    return np.maximum((best - mean) * Phi + std * phi, 0.0), -Phi, phi


def log_expected_improvement(mean: NDArray, std: NDArray, best: NDArray | float) -> Partials:
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


def confidence_bound(mean: NDArray, std: NDArray, best: NDArray | float) -> Partials:
    """How far the lower confidence bound mean - 2 std lies below the best, made positive, and its logarithm taken.

    log log(1 + exp(best - mean + 2 std)) increases with the bound's depth, so that its maximum is the bound's minimum
    (the upper confidence bound of Srinivas et al. 2010, for a cost); being the logarithm of something positive it can
    be weighed with a probability.
    """
    depth = best - mean + _CONFIDENCE * std
    positive = np.logaddexp(0.0, depth)
    slope = expit(depth) / positive
    return np.log(positive), -slope, _CONFIDENCE * slope


ACQUISITIONS: dict[str, Acquisition] = {
    "log_ei": Acquisition(log_expected_improvement, alternating=True),
    "ei": Acquisition(expected_improvement, logarithm=False),
    "noisy_ei": Acquisition(log_expected_improvement, noisy=True),
    "ucb": Acquisition(confidence_bound),
}


def acquisition_named(name: str) -> Acquisition:
    """Return the acquisition of that name; ValueError lists the known ones."""
    return choose("acquisition", ACQUISITIONS, name)
