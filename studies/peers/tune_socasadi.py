"""This package's search, with its defaults and with the paper's settings."""

import warnings

import numpy as np

from socasadi.tune import Optimizer, Space

with warnings.catch_warnings():
    import GPy  # noqa: F401  # now: what the others import is on nobody's clock either


class Socasadi:
    """An `Optimizer`, which is told of failures as such."""

    def __init__(self, optimizer: Optimizer) -> None:
        self._optimizer = optimizer

    @classmethod
    def default(cls, space: Space, seed: int) -> "Socasadi":
        return cls(Optimizer(space, seed=seed))

    @classmethod
    def paper(cls, space: Space, seed: int) -> "Socasadi":
        return cls(Optimizer.paper(space, seed))

    def ask(self) -> np.ndarray:
        return self._optimizer.space.to_unit(self._optimizer.ask())

    def tell(self, unit: np.ndarray, cost: float, failed: bool) -> None:
        theta = self._optimizer.space.from_unit(unit)
        if failed:
            self._optimizer.tell(theta, failed=True)
        else:
            self._optimizer.tell(theta, cost)
