"""Output transforms: what the Gaussian process models instead of the cost itself."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm, rankdata

from ._named import choose


class Transform(Protocol):
    """An increasing map of costs to targets.

    `apply` sees all costs at once, so that a transform may fit itself to them (ranks, powers); it must be a
    pure function of them. `check` refuses a cost, alone, that the transform cannot take.
    """

    def check(self, cost: float) -> None: ...
    def apply(self, costs: NDArray) -> NDArray: ...


class Log:
    """log J: for costs that span decades, as closed-loop costs over a box of models do. Needs J > 0."""

    def check(self, cost: float) -> None:
        if cost <= 0:
            raise ValueError(f'the cost is {cost} and log J is modelled: use transform="none" for J <= 0')

    def apply(self, costs: NDArray) -> NDArray:
        return np.log(costs)


class Identity:
    """J as it is."""

    def check(self, cost: float) -> None:
        if abs(cost) > 1e100:
            raise ValueError(f'the cost is {cost}, too large to be modelled as it is: use transform="log"')

    def apply(self, costs: NDArray) -> NDArray:
        return costs.copy()


class LogHalfRank:
    """log J, but above its median no farther than ranks would put it on the scale of the better half. Needs J > 0.

    A closed-loop cost is flat near its best and falls off cliffs elsewhere. How bad a bad trial was tells
    little, and modelling it leaves a stationary process no resolution where trials are good. A tail that is
    heavier than a normal one of the better half's spread therefore keeps its order only, as in Vizier's
    half-rank warping (Song et al. 2024, arXiv 2408.11527); a lighter one stays as it is.
    """

    check = Log.check

    def apply(self, costs: NDArray) -> NDArray:
        logs = np.log(costs)
        median = np.median(logs)
        bad = logs > median
        scale = np.sqrt(np.mean((logs[~bad] - median) ** 2))
        if scale == 0:
            return logs
        quantiles = norm.ppf((rankdata(logs) - 0.5) / len(logs))
        return np.where(bad, np.minimum(logs, median + scale * quantiles), logs)


TRANSFORMS: dict[str, Transform] = {"log-half-rank": LogHalfRank(), "log": Log(), "none": Identity()}


def transform_named(name: str) -> Transform:
    """Return the transform of that name; ValueError lists the known ones."""
    return choose("transform", TRANSFORMS, name)
