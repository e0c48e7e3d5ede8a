"""What is believed of a process's hyperparameters before any data: minus the logarithms of prior densities.

Each takes the logarithms of the hyperparameters that it is about, and returns the penalty and its gradient by them.
Points are in the unit cube and targets standardised. Constant terms are left out.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

_SCALE = math.sqrt(3.0)
_APART = 0.5
_BALANCE = 2.0
LIKELY_VARIANCE = 30.0


def lengthscale_penalty(logs: NDArray, akin: bool = True) -> tuple[float, NDArray]:
    """Of lengthscales (d): each LogNormal(sqrt(2) + log(d)/2, sqrt(3)), and `akin` ones of one family.

    The first is of Hvarfner, Hellsten and Nardi 2024, "Vanilla Bayesian optimization performs great in high
    dimensions", arXiv 2402.02229. The second is a normal deviation of 0.5 of each logarithm from the mean of all: what
    the likelihood of two or three dozen data makes of a dozen lengthscales is mostly chance.
    """
    standard = (logs - math.sqrt(2.0) - 0.5 * math.log(len(logs))) / _SCALE
    # The density of the lengthscale itself, not of its logarithm: hence the sum.
    value, slope = 0.5 * standard @ standard + logs.sum(), standard / _SCALE + 1.0
    if akin:
        apart = (logs - logs.mean()) / _APART
        value, slope = value + 0.5 * apart @ apart, slope + apart / _APART
    return float(value), slope


def noise_penalty(logs: NDArray, median: float, deviation: float) -> tuple[float, NDArray]:
    """Of the noise's variance (1): log-normal with that median, and that deviation of its logarithm.

    Few data cannot tell a rough cost from a noisy one, and a process without noise bends to every ripple.
    """
    standard = (logs - math.log(median)) / deviation
    return 0.5 * float(standard @ standard), standard / deviation


def balance_penalty(logs: NDArray) -> tuple[float, NDArray]:
    """Of a kernel's variances, the first and the last: normal deviation of 2 of the logarithm of their ratio."""
    standard = (logs[0] - logs[-1]) / _BALANCE
    slope = np.zeros_like(logs)
    slope[0] = standard / _BALANCE
    slope[-1] = -slope[0]
    return 0.5 * float(standard**2), slope


def variance_penalty(logs: NDArray) -> tuple[float, NDArray]:
    """Of a classifier's latent variance (1): log-normal about 30, with a deviation of 1.

    An experiment fails for a reason: the same one mostly fails again, and its neighbours, too. With a small variance an
    outcome would be chance instead, and a success among failures no place to go on from.
    """
    apart = logs - math.log(LIKELY_VARIANCE)
    return 0.5 * float(apart @ apart), apart
