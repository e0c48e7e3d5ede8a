from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from ..campaign import Pilot, Study
from ..model import Entry, StateSpace, identify
from ..mpc import DesignError
from ..tune import Optimizer, RandomSearch, Search, SobolSearch, Space
from ._lab import Lab

Information = Literal["data sheet", "plant model"]

_WITHOUT_FLIGHT = 1000
"""Thetas in a row that give no controller, after which a search is over."""


@dataclass(frozen=True)
class Method(ABC):
    """A way to get a controller for a robot of which nothing is known but its data sheet and what it shows.

    One of one's own is a frozen dataclass that inherits this one and defines :meth:`offers`.
    """

    @property
    def information(self) -> Information:
        """What it is told beforehand: ``"plant model"`` if it reads the true robot's parameters."""
        return "data sheet"

    @abstractmethod
    def offers(self, lab: Lab) -> Iterator[Pilot]:
        """Spend the lab's time, and yield a controller whenever there is a better one than that before.

        What counts at a checkpoint is the last controller before it. The lab ends it all by :class:`BudgetSpent`, which
        is not to be caught.
        """


def search_for(kind: str, space: Space, study: Study, initial: Sequence[ArrayLike] = ()) -> Search:
    """A fresh search by name, seeded as a campaign of the study."""
    match kind:
        case "bayesian":
            return Optimizer(space, seed=study.seed, seed_points=study.seed_points, initial=initial)
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
) -> Iterator[Pilot]:
    """Fly what ``build`` makes of the knobs' values, and look for the best until the time is spent.

    This is what a campaign does with theta: the same search, the same noise, hopeless flights cut alike. The best is
    the one that the search estimates, the luck of its flight left out, where it estimates any.

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
    """
    study, search, in_vain = lab.study, search_for(kind, Space(knobs), lab.study, initial), 0
    while in_vain < _WITHOUT_FLIGHT:
        theta, number = search.ask(), len(search.trials) + 1
        try:
            pilot = build(theta)
        except DesignError:
            search.tell(theta, failed=True)
            in_vain += 1
            continue
        best = search.best.cost if search.best else None
        give_up = None if best is None or study.give_up is None else study.give_up * best
        episode, in_vain = lab.fly(pilot, give_up=give_up, number=number), 0
        if episode.cut is not None:
            search.tell(theta, at_least=episode.cut)
        else:
            J = lab.cost(episode)
            search.tell(theta, J, failed=J is None)
        if lab.due and (chosen := search.best_estimated or search.best) is not None:
            yield build(chosen.theta)


def identified(lab: Lab, probing: float) -> StateSpace:
    """The model of the study's family that fits a probing record of so many s best."""
    mpc = lab.study.mpc
    return mpc.model.state_space(identify(mpc.model, lab.probe(probing), seed=lab.study.seed), mpc.sample_time)


def static_gain(model: StateSpace) -> np.ndarray:
    """How outputs at rest depend on inputs that are held (p, m)."""
    A, B, C, D = model
    return C @ np.linalg.solve(np.eye(len(A)) - A, B) + D
