"""What every search does: ask for a point, be told what came out."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
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
    def best_estimated(self) -> Estimate | None: ...
    @property
    def timings(self) -> Timings: ...

    def ask(self, pending: Sequence[ArrayLike] = ()) -> NDArray: ...

    def tell(
        self,
        theta: ArrayLike,
        cost: float | None = None,
        *,
        failed: bool = False,
        at_least: float | None = None,
        measured: Mapping[str, float] | None = None,
        deviation: float | None = None,
    ) -> None: ...


@dataclass(frozen=True, eq=False)
class Trial:
    """One told experiment.

    Parameters
    ----------
    theta : ndarray (d,)
        Read-only.
    cost : float or None
        None when it failed or was cut.
    at_least : float or None
        What the cost is at least, of an experiment that was cut.
    measured : mapping
        Values of limited quantities, by name.
    deviation : float or None
        Standard deviation of this cost's noise, where it is known.
    """

    theta: NDArray
    cost: float | None
    at_least: float | None = None
    measured: Mapping[str, float] = field(default_factory=lambda: MappingProxyType({}))
    deviation: float | None = None

    @property
    def known(self) -> float | None:
        """The cost, or what it is at least; None of an experiment that failed."""
        return self.at_least if self.cost is None else self.cost

    @property
    def failed(self) -> bool:
        """Whether the experiment gave neither a cost nor a bound of it."""
        return self.known is None


@dataclass(frozen=True, eq=False)
class Estimate:
    """The told theta whose cost without noise is believed to be the lowest.

    Parameters
    ----------
    index : int
        Of its trial, from 0.
    theta : ndarray (d,)
    cost : float
        The median of what is believed.
    low, high : float
        Between these the cost lies with a probability of 90 %, if it is one of those that the Gaussian process expects.
        Where a noisy cost of many parameters is known at few points, it is too sure: of ten parameters and 60 points
        it held half of the truths, where nine of ten were said. Then only flights of that theta tell.
    """

    index: int
    theta: NDArray
    cost: float
    low: float
    high: float


@dataclass(frozen=True)
class Timings:
    """Seconds that the last `ask` spent on the surrogate's `fit` and on maximising the `acquisition`."""

    fit: float = 0.0
    acquisition: float = 0.0


class History:
    """The told trials of one search, checked as they come in.

    Every search keeps one; all that it asks follows from its settings and this history.
    """

    def __init__(self, space: Space, limits: Mapping[str, float] | None = None) -> None:
        self.space = space
        self.limits = {name: _number(f"the limit of {name!r}", limit) for name, limit in (limits or {}).items()}
        self.trials: tuple[Trial, ...] = ()

    def check(
        self,
        theta: ArrayLike,
        cost: float | None,
        failed: bool,
        at_least: float | None,
        measured: Mapping[str, float] | None,
        deviation: float | None,
    ) -> Trial:
        """Return the trial that is told, or raise ValueError with one sentence when it contradicts itself."""
        values = self.space.check(theta)
        if (cost is not None) + (at_least is not None) + bool(failed) != 1:
            told = f"cost={cost!r}, at_least={at_least!r}, failed={failed!r}"
            raise ValueError(f"a trial was told with {told}: tell a cost, or at_least, or failed=True")
        if cost is not None:
            cost = _number("the cost", cost, "; tell failed=True for a trial that has no finite cost")
        if at_least is not None:
            at_least = _number("the least cost of a trial that was cut", at_least)
        measured = {name: _number(name, value) for name, value in (measured or {}).items()}
        if unknown := sorted(set(measured) - set(self.limits)):
            raise ValueError(f"{unknown[0]!r} was measured, but the limits are on {sorted(self.limits)}")
        if cost is not None and (missing := sorted(set(self.limits) - set(measured))):
            raise ValueError(f"there is a limit on {missing[0]!r}: tell it, measured={{{missing[0]!r}: ...}}")
        if deviation is not None and _number("the deviation", deviation) < 0:
            raise ValueError(f"the deviation of the cost is {deviation}: it cannot be negative")
        values.setflags(write=False)
        return Trial(values, cost, at_least, MappingProxyType(measured), deviation)

    def append(self, trial: Trial) -> None:
        """Record a checked trial."""
        self.trials = (*self.trials, trial)

    @property
    def best(self) -> Trial | None:
        """The first trial with the lowest cost of those that kept all limits; None while there is none."""
        done = [trial for trial in self.trials if keeps_limits(trial, self.limits)]
        return min(done, key=lambda trial: trial.cost if trial.cost is not None else np.inf, default=None)


def keeps_limits(trial: Trial, limits: Mapping[str, float]) -> bool:
    """Whether the trial has a cost and nothing that was measured is beyond its limit."""
    return trial.cost is not None and all(trial.measured[name] <= limit for name, limit in limits.items())


def _number(what: str, value: float, hint: str = "") -> float:
    try:
        number = float(value)
    except (TypeError, ValueError) as error:
        raise ValueError(f"{what} must be a number, not {value!r}{hint}") from error
    if not math.isfinite(number):
        raise ValueError(f"{what} is {number}: it must be finite{hint}")
    return number


def check_seed(seed: int) -> int:
    """Return the seed as an int, or raise: a search without a seed could not be resumed."""
    if isinstance(seed, bool) or not isinstance(seed, int | np.integer) or seed < 0:
        raise ValueError(f"the seed is {seed!r}: it must be an integer, 0 or more")
    return int(seed)
