"""SMAC: its `BlackBoxFacade`, the one with a Gaussian process.

Its documentation advises that one for a few continuous parameters and few evaluations; that of its other candidate,
`HyperparameterOptimizationFacade`, is a random forest, for many, categorical or conditional parameters.
"""

import logging
import tempfile
import warnings
from pathlib import Path

import numpy as np
from ConfigSpace import Configuration, ConfigurationSpace, Float  # pyright: ignore[reportMissingImports]
from smac import BlackBoxFacade, Scenario  # pyright: ignore[reportMissingImports]
from smac.runhistory.dataclasses import TrialInfo, TrialValue  # pyright: ignore[reportMissingImports]

from socasadi.tune import Space


class Smac:
    """Each point is tried once; what it would write after each trial is left out."""

    def __init__(self, space: Space, seed: int, evaluations: int) -> None:
        self._names = [f"x{i:02}" for i in range(space.dimension)]
        self._cube = ConfigurationSpace(seed=seed)
        self._cube.add([Float(name, (0.0, 1.0)) for name in self._names])
        self._folder = tempfile.TemporaryDirectory()
        scenario = Scenario(
            self._cube,
            output_directory=Path(self._folder.name),
            deterministic=True,
            n_trials=evaluations,
            seed=seed,
        )
        self._facade = BlackBoxFacade(
            scenario,
            lambda config, seed=0: 0.0,
            initial_design=BlackBoxFacade.get_initial_design(scenario, n_configs=0),
            overwrite=True,
            logging_level=logging.ERROR,
        )
        self._open: TrialInfo | None = None

    def ask(self) -> np.ndarray:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            trial = self._facade.ask()
        self._open = trial
        return np.array([float(trial.config[name]) for name in self._names])

    def tell(self, unit: np.ndarray, cost: float, failed: bool) -> None:
        trial = self._open
        if trial is None:
            values = dict(zip(self._names, unit.tolist(), strict=True))
            trial = TrialInfo(Configuration(self._cube, values=values), seed=0)
        self._facade.tell(trial, TrialValue(cost=cost, time=0.0), save=False)
        self._open = None
