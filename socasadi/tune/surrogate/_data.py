"""From told trials to what a Gaussian process is fitted to, and from there to the process."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import erfcx

from .._search import Trial
from ._fit import FitSettings, fit
from ._posterior import Hyperparameters, Posterior, condition
from ._transform import Scale, Transform


@dataclass(frozen=True, eq=False)
class Data:
    """Standardised targets (transformed value - location) / scale of the trials that have any.

    `rows` (n,) are the trials' numbers, `points` (n, d) lie in the unit cube, `bound` (n,) says which targets are only
    a lower bound of the value, `known` (n,) is the variance of the noise that was told, `log_slopes` (n,) the logarithm
    of the derivative of each target by its cost.
    """

    rows: NDArray
    points: NDArray
    targets: NDArray
    bound: NDArray
    known: NDArray
    log_slopes: NDArray
    map: Scale
    location: float
    scale: float

    def standardise(self, costs: NDArray) -> NDArray:
        """Costs to targets."""
        return (self.map.forward(np.asarray(costs, dtype=float)) - self.location) / self.scale

    def restore(self, targets: NDArray) -> NDArray:
        """Targets to costs."""
        return self.map.inverse(self.location + self.scale * np.asarray(targets, dtype=float))

    def subset(self, keep: NDArray) -> Data:
        """The data of some rows only, on the same scale."""
        parts = ("rows", "points", "targets", "bound", "known", "log_slopes")
        return replace(self, **{name: getattr(self, name)[keep] for name in parts})


# A bound so many deviations above what is believed counts as one there: how far beyond says nothing more.
_FAR = 4.0


# What is larger counts as this: its square has to be a number.
_HUGE = 1e100


def cost_data(trials: Sequence[Trial], units: NDArray, transform: Transform, way: int) -> Data:
    """Data of the trials that have a cost or a lower bound of it; at least one has a cost. `way` counts its ways.

    The transform is fitted to the costs alone: a bound says where the experiment was cut, not what it costs.
    """
    rows = np.array([i for i, trial in enumerate(trials) if not trial.failed])
    told = [trials[i] for i in rows]
    bound = np.array([trial.cost is None for trial in told])
    costs = np.clip(np.array([trial.known for trial in told], dtype=float), -_HUGE, _HUGE)
    deviations = np.array([trial.deviation or 0.0 for trial in told])
    scale = transform.ways(costs)[way](costs[~bound])
    # Half the way between one deviation up and one down, as the transform is not straight; a cost stays positive.
    down = np.where(costs > 0, np.maximum(costs - deviations, 0.1 * costs), costs - deviations)
    spread = 0.5 * (scale.forward(costs + deviations) - scale.forward(down))
    return _standardised(rows, units, costs, bound, spread, scale)


def plain_data(rows: Sequence[int], values: Sequence[float], units: NDArray, transform: Transform) -> Data:
    """Data of a quantity that was measured in the trials of those numbers."""
    seen = np.clip(np.array(values, dtype=float), -_HUGE, _HUGE)
    nothing = np.zeros(len(seen))
    return _standardised(np.array(rows), units, seen, nothing.astype(bool), nothing, transform.ways(seen)[0](seen))


def surrogate(
    data: Data,
    settings: FitSettings,
    rng: np.random.Generator,
    start: Hyperparameters | None = None,
    least_noise: float = 0.0,
) -> tuple[Data, Posterior]:
    """Fit the hyperparameters, condition the process on the data, and return both.

    A lower bound becomes an observation, of the value and with the noise that leave the mean and variance of what lies
    above the bound under the process that has seen the values only (moment matching, Minka 2001, "Expectation
    propagation for approximate Bayesian inference"). One far below what is believed anyway says nothing. The
    hyperparameters are fitted to the values first, and then to the values and those means (Hutter, Hoos and
    Leyton-Brown 2011, "Bayesian optimization with censored response data"), or else they would know nothing of the
    slopes that bounds stand on. The data come back with these observations.

    Parameters
    ----------
    start : Hyperparameters, optional
        Of an earlier fit: the descent starts there, and nowhere else.
    least_noise : float
        Variance of the noise that points told more than once have shown; a fitted one is not less.
    """
    seen = data.subset(~data.bound)
    hyper = fit(seen.points, seen.targets, settings, rng, seen.known, start, least_noise)
    targets, known = data.targets.copy(), data.known.copy()
    if data.bound.any():
        targets[data.bound] = _above(*_believed(data, hyper))[0]
        hyper = fit(data.points, targets, settings, rng, known, hyper, least_noise)
        _, targets[data.bound], known[data.bound] = _above(*_believed(data, hyper))
    cost = condition(hyper, data.points, targets[:, None], hyper.noise + known)
    return replace(data, targets=targets, known=known), cost


def _believed(data: Data, hyper: Hyperparameters) -> tuple[NDArray, NDArray, NDArray]:
    """The bounds, and mean and variance of a cost there under the process that has seen the values only."""
    seen = data.subset(~data.bound)
    process = condition(hyper, seen.points, seen.targets[:, None], hyper.noise + seen.known)
    mean, std = process.predict(data.points[data.bound])
    return data.targets[data.bound], mean[:, 0], std**2 + hyper.noise


def _above(bound: NDArray, mean: NDArray, variance: NDArray) -> tuple[NDArray, NDArray, NDArray]:
    """The mean of the part of N(mean, variance) above a bound, and the observation (value, variance) that makes it."""
    width = np.sqrt(variance)
    z = np.minimum((bound - mean) / width, _FAR)
    hazard = np.sqrt(2.0 / np.pi) / erfcx(z / np.sqrt(2.0))
    # The part's variance is (1 - s) of the whole, 0 < s < 1; rounding must not make it more or less.
    s = np.clip(hazard * (hazard - z), 1e-9, 1.0 - 1e-9)
    return mean + width * hazard, mean + width * hazard / s, variance * (1.0 - s) / s


def _standardised(
    rows: NDArray, units: NDArray, costs: NDArray, bound: NDArray, deviations: NDArray, scale: Scale
) -> Data:
    values = scale.forward(costs)
    location, width = float(values[~bound].mean()), float(values[~bound].std())
    if width <= 1e-12 * max(1.0, abs(location)):
        width = 1.0
    known = np.square(deviations / width)
    slopes = scale.log_slope(costs) - np.log(width)
    return Data(rows, units[rows], (values - location) / width, bound, known, slopes, scale, location, width)
