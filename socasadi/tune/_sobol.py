"""Sequences of points as random-access lists, and the searches that know nothing else."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._quasirandom import sobol
from ._search import Estimate, History, Timings, Trial, check_seed
from ._space import Space

# Points of the sequence tried for each that may be asked, before the box is called empty.
_PATIENCE = 5000


class SobolPoints:
    """The admissible ones among the points of one scrambled Sobol sequence, the same for the same seed."""

    def __init__(self, space: Space, seed: int, admissible: Callable[[NDArray], bool] | None = None) -> None:
        self._space, self._seed, self._admissible = space, seed, admissible
        self._points = self._draw(5)
        self._kept: list[NDArray] = []
        self._seen = 0

    def _draw(self, log2_count: int) -> NDArray:
        return sobol(self._space.dimension, log2_count, np.random.default_rng(self._seed))

    def __getitem__(self, index: int) -> NDArray:
        """Theta of that index (d,); ValueError when the conditions leave nothing of the box."""
        patience = self._seen + _PATIENCE
        while len(self._kept) <= index:
            if self._seen >= patience:
                raise ValueError(
                    f"none of {_PATIENCE} points of the box keeps the conditions: widen the bounds, or loosen them"
                )
            if self._seen >= len(self._points):
                self._points = self._draw(self._seen.bit_length())
            theta = self._space.from_unit(self._points[self._seen])
            self._seen += 1
            if self._admissible is None or self._admissible(theta):
                self._kept.append(theta)
        return self._kept[index]


class RandomPoints(SobolPoints):
    """Independent points, evenly distributed, in its place."""

    def _draw(self, log2_count: int) -> NDArray:
        return np.random.default_rng(self._seed).random((2**log2_count, self._space.dimension))


class SobolSearch:
    """Space-filling points only: the baseline that an optimiser has to beat.

    Parameters
    ----------
    space : Space
    seed : int
        Scrambling of the sequence; an `Optimizer` of the same seed starts with the same points.
    limits, admissible
        As of `Optimizer`.
    """

    _sequence: type[SobolPoints] = SobolPoints

    def __init__(
        self,
        space: Space,
        seed: int = 0,
        *,
        limits: Mapping[str, float] | None = None,
        admissible: Callable[[NDArray], bool] | None = None,
    ) -> None:
        self._history = History(space, limits)
        self._points = self._sequence(space, check_seed(seed), admissible)

    @property
    def space(self) -> Space:
        """The box that is searched."""
        return self._history.space

    @property
    def trials(self) -> tuple[Trial, ...]:
        """All told trials, in order."""
        return self._history.trials

    @property
    def best(self) -> Trial | None:
        """The best observed trial, or None."""
        return self._history.best

    @property
    def best_estimated(self) -> Estimate | None:
        """None: nothing is estimated here."""
        return None

    @property
    def timings(self) -> Timings:
        """Zeros: nothing is fitted."""
        return Timings()

    def ask(self, pending: Sequence[ArrayLike] = ()) -> NDArray:
        """Return the next theta (d,): the point whose index is the number of trials told so far and pending."""
        return self._points[len(self.trials) + len(pending)].copy()

    def tell(
        self,
        theta: ArrayLike,
        cost: float | None = None,
        *,
        failed: bool = False,
        at_least: float | None = None,
        measured: Mapping[str, float] | None = None,
        deviation: float | None = None,
    ) -> None:
        """Record a trial; see `Optimizer.tell`."""
        self._history.append(self._history.check(theta, cost, failed, at_least, measured, deviation))


class RandomSearch(SobolSearch):
    """Independent points, evenly distributed: the baseline of the baseline. Its parameters are the same."""

    _sequence = RandomPoints
