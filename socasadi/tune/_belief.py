"""What a list of told trials says: of the cost, of the limited quantities, of where experiments fail."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq
from scipy.special import ndtr

from ._search import Estimate, Trial, keeps_limits
from ._space import Space
from .surrogate import (
    Data,
    FitSettings,
    Hyperparameters,
    Posterior,
    Transform,
    classify,
    condition,
    cost_data,
    draw,
    evidence,
    fit,
    plain_data,
    surrogate,
    transform_named,
)

FIRST_REPEAT = 20
"""Trials after which the best told point is asked again, which shows how much noise there is."""

# A value drawn at a told point is exact; so much of the variance keeps the matrix regular.
_EXACT = 1e-6

# Hyperparameters that an estimate averages over, and what it holds for the noise before the data: too little would make
# it too sure.
_DRAWN = 16
_LIKELY_NOISE = (1e-1, 2.0)

# By so much the logarithm of another way's evidence has to be above the first's: several ways are tried, and each is
# fitted to the same costs.
_PREFERENCE = 6.0

# So many trials, and each multiple of the period after them, get a full fit; between, the descent starts at its result.
# The period is doubled at 200, 400, 800, ... trials.
_ALL_FULL = 30
_PERIOD, _FIRST_DOUBLED = 5, 200

# Kinds of processes, of which one is drawn for each number of trials, for they are not wrong in the same places: bold
# or not, with the kernel's sum or not. Every other one is the kind that predicts best where nothing is known of the
# cost. Once noise was seen, which the others take for features of the cost, it is the only one; costs that are nearly
# sums, or whose parameters have scales of their own, are found by the others.
_KINDS = ((False, False), (True, False), (False, False), (False, True))


def last_full_fit(told: int) -> int:
    """The number of trials, of `told` ones, whose fit had all its starts."""
    period = 1 if told <= _ALL_FULL else _PERIOD << (told // _FIRST_DOUBLED).bit_length()
    return told - told % period


@dataclass(frozen=True, eq=False)
class Start:
    """What a fit found: which way of the transform, and the hyperparameters."""

    way: int
    hyperparameters: Hyperparameters


@dataclass(frozen=True, eq=False)
class Believer:
    """How told trials are made into processes; what it finds is a pure function of them.

    Parameters
    ----------
    space, transform, settings, limits, active_set, seed
        As of the optimiser.
    """

    space: Space
    transform: Transform
    settings: FitSettings
    limits: Mapping[str, float]
    active_set: int
    seed: int

    def units(self, trials: Sequence[Trial]) -> NDArray:
        """The thetas of the trials in the unit cube (n, d)."""
        return np.array([self.space.to_unit(trial.theta) for trial in trials])

    def cost(self, trials: Sequence[Trial], start: Start | None) -> tuple[Data, Posterior, Start]:
        """The cost's process, of which one trial at least has told a cost, and where the next descent may start."""
        units = self.units(trials)
        ways = len(self.transform.ways(np.array([trial.known for trial in trials if trial.known is not None])))
        # A way that only positive costs can go ends with the first one that is not.
        way = self._way(trials, units, ways) if start is None or start.way >= ways else start.way
        rng = np.random.default_rng([self.seed, len(trials), 0])
        hyper = None if start is None else start.hyperparameters
        data = self._data(trials, units, way)
        data, cost = surrogate(data, self._settings(trials), rng, hyper, _seen_noise(trials, data))
        return data, cost, Start(way, cost.hyperparameters)

    def _settings(self, trials: Sequence[Trial]) -> FitSettings:
        if noise_seen(trials):
            return replace(self.settings, additive=False)
        # By lot, and not in turn: points that are asked at once all see the same number of trials.
        bold, sums = _KINDS[np.random.default_rng([self.seed, len(trials), 5]).integers(len(_KINDS))]
        additive = self.settings.additive and sums and self.space.dimension > 1
        return replace(self.settings, bold=bold, additive=additive)

    def _data(self, trials: Sequence[Trial], units: NDArray, way: int) -> Data:
        data = cost_data(trials, units, self.transform, way)
        broken = np.array([not keeps_limits(trials[row], self.limits) for row in data.rows])
        rng = np.random.default_rng([self.seed, len(trials), 3])
        # Trials that may be the best before costs that broke a limit, and those before bounds.
        return data.subset(_active(np.lexsort((data.targets, broken, data.bound)), self.active_set, rng))

    def _way(self, trials: Sequence[Trial], units: NDArray, ways: int) -> int:
        """Which way makes the costs most probable: by the evidence of its targets times the slopes; if in doubt, 0."""
        if ways == 1:
            return 0
        scores = []
        for way in range(ways):
            data = self._data(trials, units, way)
            data = data.subset(~data.bound)
            likely = evidence(data.points, data.targets, self._settings(trials), data.known)
            scores.append(likely + data.log_slopes.sum())
        scores[0] += _PREFERENCE
        return int(np.argmax(scores))

    def belief(self, trials: Sequence[Trial], start: Start | None) -> Belief:
        """All that the trials say."""
        units = self.units(trials)
        data, cost, found = self.cost(trials, start)
        failed = np.array([trial.failed for trial in trials])
        failure = None
        if failed.any():
            rng = np.random.default_rng([self.seed, len(trials), 1])
            rows = _active(np.argsort(~failed, kind="stable"), self.active_set, rng)
            failure = classify(units[rows], failed[rows], self.settings.kernel)
        limited = [self._limited(name, trials, units) for name in self.limits]
        return Belief(trials, units, data, cost, found, failure, limited)

    def estimate(self, belief: Belief, keep: Callable[[Trial], bool]) -> Estimate:
        """The trial of least expected cost among those with that property.

        Reckons with what the trials leave open of the hyperparameters, of the noise above all: the fitted ones alone
        would be too sure. The trial that was observed as the best gives way only to one that is better under all of
        them, and to none before a repeat could show any noise: of few trials they may hold all differences for noise.
        """
        data, rows = belief.data, belief.rows_that(keep)
        if noise_seen(belief.trials) is False:
            best = int(data.targets[rows].argmin())
            index = int(data.rows[rows[best]])
            cost = float(data.restore(data.targets[rows[best]]))
            return Estimate(index, belief.trials[index].theta, cost, cost, cost)
        rng = np.random.default_rng([self.seed, len(belief.trials), 4])
        settings = replace(self.settings, additive=False, likely_noise=_LIKELY_NOISE)
        about = data.points, data.targets, settings, rng, data.known
        least = _seen_noise(belief.trials, data)
        drawn = draw(*about, fit(*about, None, least), _DRAWN, least)
        told = [condition(one, data.points, data.targets[:, None], one.noise + data.known) for one in drawn]
        means, deviations = zip(*(process.predict(data.points[rows]) for process in told), strict=True)
        means = np.hstack(means)
        observed = data.targets[rows].argmin()
        surer = (means < means[observed]).all(axis=1)
        if noise_seen(belief.trials) is None and len(belief.trials) <= FIRST_REPEAT:
            surer[:] = False
        surer[observed] = True
        best = int(np.where(surer, means.mean(axis=1), np.inf).argmin())
        chances = _quantiles(means[best], np.array(deviations)[:, best], (0.05, 0.5, 0.95))
        low, middle, high = data.restore(chances).tolist()
        index = int(data.rows[rows[best]])
        return Estimate(index, belief.trials[index].theta, middle, low, high)

    def _limited(self, name: str, trials: Sequence[Trial], units: NDArray) -> tuple[Posterior, float]:
        rows = [i for i, trial in enumerate(trials) if name in trial.measured]
        data = plain_data(rows, [trials[i].measured[name] for i in rows], units, transform_named("yeo-johnson"))
        limit = float(data.standardise(np.array([self.limits[name]]))[0])
        rng = np.random.default_rng([self.seed, len(trials), 2])
        near = _active(np.argsort(np.abs(data.targets - limit), kind="stable"), self.active_set, rng)
        _, posterior = surrogate(data.subset(near), FitSettings(restarts=1), rng)
        return posterior, limit


@dataclass(frozen=True, eq=False)
class Belief:
    """The fitted processes.

    Parameters
    ----------
    trials : sequence of Trial
    units : ndarray (n, d)
        Their thetas in the unit cube.
    data : Data
        What the cost's process was fitted to.
    cost : Posterior
    found : Start
        Where the next descent may start.
    failure : Posterior or None
        Latent value of failure (see `classify`); None while nothing failed.
    limited : list of (Posterior, float)
        Process of each limited quantity, with its limit on the same scale.
    """

    trials: Sequence[Trial]
    units: NDArray
    data: Data
    cost: Posterior
    found: Start
    failure: Posterior | None
    limited: list[tuple[Posterior, float]]

    def rows_that(self, keep: Callable[[Trial], bool]) -> NDArray:
        """Indices into the data of the trials with that property."""
        return np.array([i for i, row in enumerate(self.data.rows) if keep(self.trials[row])], dtype=int)

    def imagined(self, points: NDArray, worlds: int, rng: np.random.Generator) -> Posterior:
        """The cost's process in worlds where costs were observed at further points (m, d), drawn from it."""
        noise = self.cost.hyperparameters.noise
        drawn = self.cost.sample(points, worlds, rng)
        drawn += np.sqrt(noise) * rng.standard_normal(drawn.shape)
        told = np.tile(self.data.targets[:, None], (1, worlds))
        return condition(
            self.cost.hyperparameters,
            np.vstack([self.cost.points, points]),
            np.vstack([told, drawn]),
            np.concatenate([noise + self.data.known, np.full(len(points), noise)]),
        )

    def hidden(self, points: NDArray, worlds: int, rng: np.random.Generator) -> Posterior:
        """The cost's process in worlds where the costs without noise are known, at the told and at further points."""
        known = np.vstack([self.cost.points, points]) if len(points) else self.cost.points
        drawn = self.cost.sample(known, worlds, rng)
        return condition(self.cost.hyperparameters, known, drawn, _EXACT * self.cost.hyperparameters.prior_variance)


def noise_seen(trials: Sequence[Trial]) -> bool | None:
    """Whether costs have noise: it was told, or a point was told different ones; None while nothing says so or not."""
    if any(trial.deviation for trial in trials):
        return True
    if not (costs := _repeated(trials)):
        return None
    return any(np.ptp(told) > 1e-10 * np.abs(told).max() for told in costs)


def _quantiles(means: NDArray, deviations: NDArray, levels: Sequence[float]) -> NDArray:
    """Quantiles (q,) at levels (q,) of a mixture of normal distributions in equal parts: means, deviations (k,)."""
    ends = means + 9 * np.outer((-1, 1), deviations)

    def excess(x: float, level: float) -> float:
        return float(ndtr((x - means) / deviations).mean()) - level

    return np.array([brentq(excess, ends.min(), ends.max(), args=(level,)) for level in levels])


def _repeated(trials: Sequence[Trial]) -> list[NDArray]:
    """The costs of each theta that was told more than one."""
    costs: dict[bytes, list[float]] = {}
    for trial in trials:
        if trial.cost is not None:
            costs.setdefault(trial.theta.tobytes(), []).append(trial.cost)
    return [np.array(told) for told in costs.values() if len(told) > 1]


def _seen_noise(trials: Sequence[Trial], data: Data) -> float:
    """Variance of the noise among the targets of thetas that were told more than once; 0 where none was."""
    groups = [data.standardise(costs) for costs in _repeated(trials)]
    freedom = sum(len(group) - 1 for group in groups)
    return sum(float(((group - group.mean()) ** 2).sum()) for group in groups) / freedom if freedom else 0.0


def _active(order: NDArray, size: int, rng: np.random.Generator) -> NDArray:
    """Which data are used: all, or of `size` the first half in that order and a random choice of the others."""
    if len(order) <= size:
        return np.arange(len(order))
    half = size - size // 2
    return np.sort(np.concatenate([order[:half], rng.choice(order[half:], size // 2, replace=False)]))
