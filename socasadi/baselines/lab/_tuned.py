"""What a campaign does with theta, for any numbers of a method."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from ...campaign import Pilot, Study
from ...model import Entry
from ...mpc import DesignError
from ...plant import Plant
from ...tune import Optimizer, RandomSearch, Search, SobolSearch, Space
from ._lab import Lab

BESIDE_MODEL = ("R", ("input_noise", 1e-4, 100.0), ("disturbance_noise", 1e-4, 100.0))
"""What of an MPC may be tuned beside its model, as of :class:`LinearMPC`: the effort, and what the observer assumes.

At the lower ends the model is all but believed. Of Q and R only the quotient matters, and of the sensor's noise and the
others.
"""

_IN_VAIN = 1000
"""Thetas in a row that give no controller, or one whose flight fails, after which a search is over."""


def search_for(kind: str, space: Space, study: Study, initial: Sequence[ArrayLike] = ()) -> Search:
    """A fresh search by name, seeded as a campaign of the study; few numbers take few points to start with."""
    match kind:
        case "bayesian":
            seed_points = min(study.seed_points, 2 * space.dimension)
            return Optimizer(space, seed=study.seed, seed_points=seed_points, initial=initial)
        case "sobol":
            return SobolSearch(space, study.seed)
        case "random":
            return RandomSearch(space, study.seed)
    raise ValueError(f"unknown search {kind!r}; there are bayesian, sobol, random")


def tuned(
    lab: Lab,
    knobs: Sequence[Entry],
    build: Callable[[np.ndarray], Pilot],
    *,
    kind: str = "bayesian",
    initial: Sequence[ArrayLike] = (),
    over: Sequence[Callable[[Plant], Plant]] = (),
    by: Literal["mean", "worst"] = "mean",
    most: float = np.inf,
) -> Iterator[Pilot]:
    """Fly what ``build`` makes of the knobs' values, and look for the best until the time is spent.

    This is what a campaign does with theta: the same search, the same noise, hopeless flights cut alike. The best is
    the one that a Gaussian process estimates, the luck of its flight left out, whatever asked for it.

    Parameters
    ----------
    knobs
        What is open: names, bounds, scales.
    build
        A controller of their values; DesignError where they give none.
    kind
        ``"bayesian"``, ``"sobol"`` or ``"random"``.
    initial
        Values that are tried first.
    over
        Other robots, each made of the study's own, on all of which every controller is flown beside it. They take the
        robot's time in turn.
    by
        What counts of the several J.
    most
        Trials after which the best so far is left as it is, though there be time.

    Raises
    ------
    BudgetSpent
        The lab's time is over before the search is.
    """
    study, space, in_vain, before = lab.study, Space(knobs), 0, lab.numbered
    search = search_for(kind, space, study, initial)
    judge = search if isinstance(search, Optimizer) else Optimizer(space, seed=study.seed)
    told = {search, judge}
    plants = [None, *(other(study.plant) for other in over)]
    while in_vain < _IN_VAIN and len(search.trials) < most:
        theta, number = search.ask(), before + len(search.trials) + 1
        try:
            pilot = build(theta)
        except DesignError:
            _tell(told, theta, _Outcome())
            in_vain += 1
            continue
        best = search.best.cost if search.best else None
        give_up = None if best is None or study.give_up is None else study.give_up * best
        outcome = _flown(lab, pilot, plants, by, give_up, number)
        in_vain = in_vain + 1 if outcome.failed else 0
        _tell(told, theta, outcome)
        if lab.due(len(plants)) and (chosen := judge.best_estimated or judge.best) is not None:
            yield build(chosen.theta)
    if (chosen := judge.best_estimated or judge.best) is not None:
        yield build(chosen.theta)


@dataclass(frozen=True)
class _Outcome:
    """What a controller costs, or at least costs; neither where it failed."""

    J: float | None = None
    at_least: float | None = None

    @property
    def failed(self) -> bool:
        return self.J is None and self.at_least is None


def _flown(
    lab: Lab, pilot: Pilot, plants: Sequence[Plant | None], by: str, give_up: float | None, number: int
) -> _Outcome:
    """One flight on each of the robots; none after one that fails, or that proves the whole to be hopeless."""
    costs: list[float] = []
    for plant in plants:
        # What of the whole a single flight may still take.
        spare = None if give_up is None else give_up if by == "worst" else len(plants) * give_up - sum(costs)
        episode = lab.fly(pilot, give_up=spare, number=number, plant=plant)
        if episode.cut is not None:
            costs.append(episode.cut)
            return _Outcome(at_least=max(costs) if by == "worst" else sum(costs) / len(plants))
        if (J := lab.cost(episode)) is None:
            return _Outcome()
        costs.append(J)
    return _Outcome(max(costs) if by == "worst" else sum(costs) / len(plants))


def _tell(searches: set[Search], theta: np.ndarray, outcome: _Outcome) -> None:
    for search in searches:
        search.tell(theta, outcome.J, failed=outcome.failed, at_least=outcome.at_least)
