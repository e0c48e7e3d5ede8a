"""What every search is to be able to do here, those that are compared, and the one that knows nothing.

All search the unit cube: whoever uses a peer would hand it the logarithm of what is a scale and the bounds of the rest,
so nobody is given an advantage by it. A peer is set up as its documentation advises for a small budget of a continuous
function and left at its defaults otherwise; linear algebra has one thread.
"""

from collections.abc import Callable
from dataclasses import dataclass
from importlib import metadata, util
from typing import Protocol

import numpy as np

from socasadi.tune import Space


class Search(Protocol):
    """Minimises over the unit cube; whoever has no notion of a failure takes `cost`, the worst that was seen."""

    def ask(self) -> np.ndarray: ...
    def tell(self, unit: np.ndarray, cost: float, failed: bool) -> None: ...


@dataclass(frozen=True)
class Method:
    """A search that is compared: `make(space, seed, evaluations)` sets it up; `needs` are its packages."""

    name: str
    title: str
    make: Callable[[Space, int, int], Search]
    needs: tuple[str, ...] = ()
    log: bool = False

    @property
    def missing(self) -> str | None:
        """The first of its packages that is not installed."""
        return next((module for module in self.needs if util.find_spec(module.split(":")[0]) is None), None)

    @property
    def versions(self) -> dict[str, str]:
        """Of its packages, by the names under which they are distributed."""
        names = [need.split(":")[-1] for need in self.needs]
        return {name: metadata.version(name) for name in names}


class Random:
    """Uniformly distributed points."""

    def __init__(self, space: Space, seed: int, evaluations: int) -> None:
        self._random, self._dimension = np.random.default_rng([seed, 1]), space.dimension

    def ask(self) -> np.ndarray:
        return self._random.uniform(size=self._dimension)

    def tell(self, unit: np.ndarray, cost: float, failed: bool) -> None:
        """Nothing is learned."""


def botorch(space: Space, seed: int, evaluations: int) -> Search:
    from .tune_botorch import BoTorch

    return BoTorch(space, seed)


def optuna_gp(space: Space, seed: int, evaluations: int) -> Search:
    from .tune_optuna import Optuna

    return Optuna(space, seed, "GPSampler")


def optuna_tpe(space: Space, seed: int, evaluations: int) -> Search:
    from .tune_optuna import Optuna

    return Optuna(space, seed, "TPESampler")


def skopt(space: Space, seed: int, evaluations: int) -> Search:
    from .tune_skopt import ScikitOptimize

    return ScikitOptimize(space, seed)


def bayes_opt(space: Space, seed: int, evaluations: int) -> Search:
    from .tune_bayes_opt import BayesianOptimization

    return BayesianOptimization(space, seed)


def smac(space: Space, seed: int, evaluations: int) -> Search:
    from .tune_smac import Smac

    return Smac(space, seed, evaluations)


def ours(space: Space, seed: int, evaluations: int) -> Search:
    from .tune_socasadi import Socasadi

    return Socasadi.default(space, seed)


def paper(space: Space, seed: int, evaluations: int) -> Search:
    from .tune_socasadi import Socasadi

    return Socasadi.paper(space, seed)


# A need is the name of the module, with that of the distribution after a colon where they differ.
METHODS = {
    method.name: method
    for method in (
        Method("random", "random", Random),
        Method("optuna-tpe", "Optuna TPE", optuna_tpe, ("optuna",)),
        Method("optuna-gp", "Optuna GP", optuna_gp, ("optuna", "torch")),
        Method("bayes-opt", "bayesian-optimization", bayes_opt, ("bayes_opt:bayesian-optimization",)),
        Method("skopt", "scikit-optimize", skopt, ("skopt:scikit-optimize",)),
        Method("smac", "SMAC, GP", smac, ("smac", "ConfigSpace")),
        Method("botorch", "BoTorch", botorch, ("botorch", "torch")),
        Method("botorch-log", "BoTorch, log J", botorch, ("botorch", "torch"), log=True),
        Method("paper", "the paper's", paper, ("GPy",)),
        Method("socasadi", "socasadi", ours, ("GPy",)),
    )
}
