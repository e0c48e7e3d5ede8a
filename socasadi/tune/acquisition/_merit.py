"""What is maximised over the cube: an acquisition, weighed with the probability that the constraints are kept."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import erfcx, log_ndtr, logsumexp

from ..surrogate import Posterior
from ._improvement import Acquisition


@dataclass(frozen=True, eq=False)
class Constraint:
    """A quantity that has to stay at or below `limit`; `spread` is the variance of what the process does not say.

    The probability is Phi((limit - mean) / sqrt(std^2 + spread)) (Gardner et al. 2014, "Bayesian optimization with
    inequality constraints"); with a limit of 0 and a spread of 1 it is that of a classifier's latent value.
    """

    posterior: Posterior
    limit: float = 0.0
    spread: float = 0.0

    def log_probability(self, x: NDArray) -> NDArray:
        """At points x (m, d), (m,)."""
        mean, std = self.posterior.predict(x)
        return log_ndtr((self.limit - mean[:, 0]) / np.sqrt(std**2 + self.spread))

    def with_gradient(self, x: NDArray) -> tuple[float, NDArray]:
        """The same at one point x (d,), with its gradient (d,)."""
        (mean,), std, (by_mean,), by_std = self.posterior.predict_with_gradient(x)
        width = np.sqrt(std**2 + self.spread)
        z = (self.limit - mean) / width
        # phi/Phi without cancellation or overflow.
        mills = np.sqrt(2.0 / np.pi) / erfcx(-z / np.sqrt(2.0))
        return float(log_ndtr(z)), -mills * (by_mean + z * std / width * by_std) / width


@dataclass(frozen=True, eq=False)
class Merit:
    """The merit of asking a point.

    Parameters
    ----------
    acquisition : Acquisition
    cost : Posterior or None
        Of the cost, in one world or several, over which the acquisition's merit is averaged. None as long as there is
        no best to improve on: then the merit is the probability of the constraints alone.
    best : ndarray (w,)
        J* of each world, on the scale of the targets.
    constraints : sequence of Constraint
    caution : float
        Power of the constraints' probability by which the acquisition is weighed.
    """

    acquisition: Acquisition
    cost: Posterior | None
    best: NDArray
    constraints: Sequence[Constraint] = ()
    caution: float = 1.0

    def __call__(self, x: NDArray) -> NDArray:
        """At points x (m, d), (m,)."""
        chance = np.zeros(len(x))
        for constraint in self.constraints:
            chance += self.caution * constraint.log_probability(x)
        if self.cost is None:
            return chance
        mean, std = self.cost.predict(x)
        value = self.acquisition.function(mean, std[:, None], self.best)[0]
        if self.acquisition.logarithm:
            return logsumexp(value, axis=1) - np.log(value.shape[1]) + chance
        return value.mean(axis=1) * np.exp(chance)

    def with_gradient(self, x: NDArray) -> tuple[float, NDArray]:
        """The same at one point x (d,), with its gradient (d,)."""
        chance, by_chance = 0.0, np.zeros_like(x)
        for constraint in self.constraints:
            log_probability, slope = constraint.with_gradient(x)
            chance += self.caution * log_probability
            by_chance += self.caution * slope
        if self.cost is None:
            return chance, by_chance
        mean, std, by_mean, by_std = self.cost.predict_with_gradient(x)
        values, of_mean, of_std = self.acquisition.function(mean, np.full(len(mean), std), self.best)
        value, weights = (_log_mean_exp if self.acquisition.logarithm else _mean)(values)
        slope = (weights * of_mean) @ by_mean + float(weights @ of_std) * by_std
        if self.acquisition.logarithm:
            return value + chance, slope + by_chance
        probability = float(np.exp(chance))
        return value * probability, probability * (slope + value * by_chance)


def _mean(values: NDArray) -> tuple[float, NDArray]:
    return float(values.mean()), np.full(len(values), 1.0 / len(values))


def _log_mean_exp(values: NDArray) -> tuple[float, NDArray]:
    """Of values (w,), with its gradient (w,); SciPy's logsumexp and softmax are made for many, and slow on so few."""
    highest = values.max()
    each = np.exp(values - highest)
    at_top = values == highest
    top = at_top.sum()
    beyond = np.log1p(np.where(at_top, 0.0, each).sum() / top)
    return float(beyond + np.log(top) + highest - np.log(len(values))), each / each.sum()
