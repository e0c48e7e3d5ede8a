"""The scrambled Sobol sequence as a random-access list, and the search that knows nothing else."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.stats import qmc

from ._search import History, Timings, Trial, check_seed
from ._space import Space


class SobolPoints:
    """Points 0, 1, 2, ... of one scrambled Sobol sequence in the unit cube, the same for the same seed."""

    def __init__(self, dimension: int, seed: int) -> None:
        self._dimension, self._seed = dimension, seed
        self._points = self._draw(5)

    def _draw(self, log2_count: int) -> NDArray:
        return qmc.Sobol(self._dimension, rng=np.random.default_rng(self._seed)).random_base2(log2_count)

    def __getitem__(self, index: int) -> NDArray:
        if index >= len(self._points):
            self._points = self._draw(index.bit_length())
        return self._points[index]


class SobolSearch:
    """Space-filling points only: the baseline that an optimiser has to beat.

    Parameters
    ----------
    space : Space
    seed : int
        Scrambling of the sequence; an `Optimizer` of the same seed starts with the same points.
    """

    def __init__(self, space: Space, seed: int = 0) -> None:
        self._history = History(space)
        self._points = SobolPoints(space.dimension, check_seed(seed))

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
        """The best observed trial that did not fail, or None."""
        return self._history.best

    @property
    def timings(self) -> Timings:
        """Zeros: nothing is fitted."""
        return Timings()

    def ask(self) -> NDArray:
        """Return the next theta (d,): the point whose index is the number of trials told so far."""
        return self.space.from_unit(self._points[len(self.trials)])

    def tell(self, theta: ArrayLike, cost: float | None = None, *, failed: bool = False) -> None:
        """Record a trial; see `Optimizer.tell`."""
        self._history.append(self._history.check(theta, cost, failed))
