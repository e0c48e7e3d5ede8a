"""Output transforms: what the Gaussian process models instead of the cost itself."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

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


TRANSFORMS: dict[str, Transform] = {"log": Log(), "none": Identity()}


def transform_named(name: str) -> Transform:
    """Return the transform of that name; ValueError lists the known ones."""
    return choose("transform", TRANSFORMS, name)
