"""What is asked next, given what the told trials say."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ._belief import FIRST_REPEAT, Belief, noise_seen
from ._search import Trial, keeps_limits
from ._space import Space
from .acquisition import Acquisition, Constraint, Merit, maximise
from .surrogate import Posterior

_INCUMBENTS = 5
_FANTASIES = 8
_HIDDEN_WORLDS = 16


@dataclass(frozen=True, eq=False)
class Chooser:
    """How a belief is made into the next theta; what it chooses is a pure function of that and of what is pending.

    Parameters
    ----------
    space, limits, admissible, repeat, seed
        As of the optimiser.
    acquisition : Acquisition
    """

    space: Space
    acquisition: Acquisition
    limits: Mapping[str, float]
    admissible: Callable[[NDArray], bool] | None
    repeat: bool
    seed: int

    def keeps_limits(self, trial: Trial) -> bool:
        """Whether a trial has a cost and kept all limits."""
        return keeps_limits(trial, self.limits)

    def may_ask(self, theta: NDArray) -> bool:
        """Whether a theta keeps the conditions that are known before any experiment."""
        return self.admissible is None or bool(self.admissible(theta))

    def choose(self, belief: Belief, waiting: NDArray) -> NDArray:
        """The theta of most merit; `waiting` (m, d) are the pending ones in the unit cube."""
        trials = belief.trials
        rng = np.random.default_rng([self.seed, len(trials), 1, len(waiting)])
        kept = belief.rows_that(self.keeps_limits)
        constraints = _constraints(belief)
        order = np.argsort(belief.data.targets, kind="stable")
        if len(kept):
            order = kept[np.argsort(belief.data.targets[kept], kind="stable")]
            cost, best = self._worlds(belief, kept, waiting, _likely(waiting, constraints), rng)
            merit = Merit(self.acquisition, cost, best, constraints, 1.0 + self._lost_in_a_row(trials))
        else:
            merit = Merit(self.acquisition, None, np.zeros(1), constraints)
        incumbents = belief.data.points[order[:_INCUMBENTS]]
        taken = np.vstack([belief.units, waiting])
        if may_repeat := self.repeat and len(kept) and not len(waiting) and noise_seen(trials) is not False:
            theta = trials[int(belief.data.rows[order[0]])].theta
            if _is_time_to_repeat(len(trials)) and self.may_ask(theta):
                return theta
        unit, value = maximise(merit, taken, incumbents, rng, lambda x: self.may_ask(self.space.from_unit(x)))
        if may_repeat:
            again = merit(belief.data.points[kept])
            theta = trials[int(belief.data.rows[kept[again.argmax()]])].theta
            if again.max() > value and self.may_ask(theta):
                return theta
        return self.space.from_unit(unit)

    def _worlds(
        self, belief: Belief, kept: NDArray, waiting: NDArray, likely: NDArray, rng: np.random.Generator
    ) -> tuple[Posterior, NDArray]:
        """The cost's process and the best in each world of what is not known: costs to come, and noise.

        Of the pending points only those that are `likely` to keep the constraints may be the best.
        """
        if self.acquisition.noisy:
            cost = belief.hidden(waiting, _HIDDEN_WORLDS, rng)
            rivals = np.vstack([belief.data.points[kept], likely])
            return cost, cost.predict(rivals)[0].min(axis=0)
        best = belief.data.targets[kept].min()
        if self.acquisition.alternating:
            mean, std = belief.cost.predict(belief.data.points[kept])
            if (len(belief.trials) + len(waiting)) % 2:
                best = mean.min()
            elif noise_seen(belief.trials):
                best = (mean[:, 0] - std).min()
        if not len(waiting):
            return belief.cost, np.array([best])
        cost = belief.imagined(waiting, _FANTASIES, rng)
        return cost, np.vstack([cost.predict(likely)[0], np.full((1, _FANTASIES), best)]).min(axis=0)

    def _lost_in_a_row(self, trials: Sequence[Trial]) -> int:
        """How many of the last trials have failed or broken a limit, one after the other.

        They say nothing of the cost, which therefore seems worth a try wherever they were; so the chance of success
        counts the more, the longer there is none.
        """
        lost = (trial.at_least is None and not self.keeps_limits(trial) for trial in reversed(trials))
        return sum(itertools.takewhile(bool, lost))


def _constraints(belief: Belief) -> list[Constraint]:
    found = [Constraint(belief.failure, 0.0, 1.0)] if belief.failure is not None else []
    return found + [Constraint(posterior, limit) for posterior, limit in belief.limited]


def _likely(points: NDArray, constraints: Sequence[Constraint]) -> NDArray:
    """Those of the points (m, d) that keep the constraints with a probability of a half or more."""
    if not len(points) or not constraints:
        return points
    chance = np.sum([constraint.log_probability(points) for constraint in constraints], axis=0)
    return points[chance >= np.log(0.5)]


def _is_time_to_repeat(told: int) -> bool:
    """Whether the best is asked again to see the noise: after 20, 40, 80, ... trials."""
    return told >= FIRST_REPEAT and told % FIRST_REPEAT == 0 and (told // FIRST_REPEAT).bit_count() == 1
