"""What every search does: ask for a point, be told what came out."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._space import Space


class Search(Protocol):
    """The interface of every search: an optimiser, or a baseline that stands beside it."""

    @property
    def space(self) -> Space: ...
    @property
    def trials(self) -> tuple[Trial, ...]: ...
    @property
    def best(self) -> Trial | None: ...
    @property
    def timings(self) -> Timings: ...

    def ask(self) -> NDArray: ...
    def tell(self, theta: ArrayLike, cost: float | None = None, *, failed: bool = False) -> None: ...


@dataclass(frozen=True, eq=False)
class Trial:
    """One told experiment: `theta` (d,), read-only, and its `cost`, which is None when it `failed`."""

    theta: NDArray
    cost: float | None
    failed: bool


@dataclass(frozen=True)
class Timings:
    """Seconds that the last `ask` spent on the surrogate's `fit` and on maximising the `acquisition`."""

    fit: float = 0.0
    acquisition: float = 0.0


class History:
    """The told trials of one search, checked as they come in.

    Every search keeps one; all that it asks follows from its settings and this history.
    """

    def __init__(self, space: Space) -> None:
        self.space = space
        self.trials: tuple[Trial, ...] = ()

    def check(self, theta: ArrayLike, cost: float | None, failed: bool) -> Trial:
        """Return the trial that is told, or raise ValueError with one sentence when it contradicts itself."""
        values = self.space.check(theta)
        if failed and cost is not None:
            raise ValueError(f"a failed trial was told with the cost {cost}: tell a cost or failed=True")
        if not failed and cost is None:
            raise ValueError("a trial was told without a cost: tell a cost, or failed=True")
        if cost is not None:
            try:
                cost = float(cost)
            except (TypeError, ValueError) as error:
                raise ValueError(f"the cost must be a number, not {cost!r}") from error
            if not math.isfinite(cost):
                raise ValueError(f"the cost is {cost}: tell failed=True for a trial that has no finite cost")
        values.setflags(write=False)
        return Trial(values, cost, bool(failed))

    def append(self, trial: Trial) -> None:
        """Record a checked trial."""
        self.trials = (*self.trials, trial)

    @property
    def best(self) -> Trial | None:
        """The first trial with the lowest cost; None while nothing but failures is known."""
        done = [trial for trial in self.trials if trial.cost is not None]
        return min(done, key=lambda trial: trial.cost if trial.cost is not None else np.inf, default=None)


def check_seed(seed: int) -> int:
    """Return the seed as an int, or raise: a search without a seed could not be resumed."""
    if isinstance(seed, bool) or not isinstance(seed, int | np.integer) or seed < 0:
        raise ValueError(f"the seed is {seed!r}: it must be an integer, 0 or more")
    return int(seed)
