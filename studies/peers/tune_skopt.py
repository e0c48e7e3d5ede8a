"""scikit-optimize: its `Optimizer` with a Gaussian process, as in `gp_minimize`, and expected improvement."""

import warnings

import numpy as np
import skopt  # pyright: ignore[reportMissingImports]

from socasadi.tune import Space


class ScikitOptimize:
    """The process of `gp_minimize`: Matern 5/2 with an amplitude and fitted noise."""

    def __init__(self, space: Space, seed: int) -> None:
        cube = [(0.0, 1.0)] * space.dimension
        self._optimizer = skopt.Optimizer(cube, "GP", n_initial_points=1, acq_func="EI", random_state=seed)
        self._told: list[tuple[list[float], float]] = []

    def ask(self) -> np.ndarray:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            points, values = zip(*self._told, strict=True)
            self._optimizer.tell(list(points), list(values))
            self._told = []
            return np.array(self._optimizer.ask())

    def tell(self, unit: np.ndarray, cost: float, failed: bool) -> None:
        # Kept until the next ask: every call of its tell fits the process and maximises the acquisition.
        self._told.append((unit.tolist(), cost))
