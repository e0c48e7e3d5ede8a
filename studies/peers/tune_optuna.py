"""Optuna: its samplers `GPSampler` and `TPESampler`, with their defaults."""

import warnings

import numpy as np
import optuna  # pyright: ignore[reportMissingImports]

from socasadi.tune import Space


class Optuna:
    """A study in memory; what was not asked is added to it as a finished trial."""

    def __init__(self, space: Space, seed: int, sampler: str) -> None:
        optuna.logging.set_verbosity(optuna.logging.ERROR)
        warnings.simplefilter("ignore", optuna.exceptions.ExperimentalWarning)
        if sampler == "GPSampler":
            import torch  # pyright: ignore[reportMissingImports]

            torch.set_num_threads(1)
        self._study = optuna.create_study(sampler=getattr(optuna.samplers, sampler)(seed=seed))
        names = [f"x{i:02}" for i in range(space.dimension)]
        self._cube = {name: optuna.distributions.FloatDistribution(0.0, 1.0) for name in names}
        self._open: optuna.Trial | None = None

    def ask(self) -> np.ndarray:
        trial = self._study.ask(self._cube)
        self._open = trial
        return np.array([trial.params[name] for name in self._cube])

    def tell(self, unit: np.ndarray, cost: float, failed: bool) -> None:
        if self._open is None:
            values = dict(zip(self._cube, unit.tolist(), strict=True))
            self._study.add_trial(optuna.create_trial(params=values, distributions=self._cube, value=cost))
        else:
            self._study.tell(self._open, cost)
            self._open = None
