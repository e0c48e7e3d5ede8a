"""bayesian-optimization: its defaults, an upper confidence bound (kappa = 2.576) over a Matern 5/2 process."""

import warnings

import bayes_opt  # pyright: ignore[reportMissingImports]
import numpy as np

from socasadi.tune import Space


class BayesianOptimization:
    """It maximises, so that costs change sign; a point may come twice, as it may under noise."""

    def __init__(self, space: Space, seed: int) -> None:
        self._names = [f"x{i:02}" for i in range(space.dimension)]
        self._optimizer = bayes_opt.BayesianOptimization(
            f=None,
            pbounds={name: (0.0, 1.0) for name in self._names},
            random_state=seed,
            verbose=0,
            allow_duplicate_points=True,
        )

    def ask(self) -> np.ndarray:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            suggested = self._optimizer.suggest()
        return np.array([float(suggested[name]) for name in self._names])

    def tell(self, unit: np.ndarray, cost: float, failed: bool) -> None:
        self._optimizer.register(params=dict(zip(self._names, unit.tolist(), strict=True)), target=-cost)
