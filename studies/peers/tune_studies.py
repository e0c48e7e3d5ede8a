"""This package's own searches: theta of a prediction model, J of one simulated episode."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from socasadi import Circle, Cost, Dense, LinearMPC, Modal, Origin, Rod, SimulatedPlant, Study
from socasadi.campaign import Task, fly
from socasadi.model import PredictionModel
from socasadi.mpc import DesignError
from socasadi.tune import Space

from .tune_functions import Problem


@dataclass(frozen=True)
class Flown:
    """J of a theta; the plant is built when the first is asked for. Sensor noise is another in every evaluation."""

    rod: str
    task: Task
    model: PredictionModel

    @cached_property
    def study(self) -> Study:
        """As in studies/unknown_arm.py: wide bounds, nothing is known about the arm."""
        mpc = LinearMPC(
            self.model, sample_time=0.05, horizon=10, Q=1e3, R=1.0, input_bounds=(-10, 10), output_bounds=(-0.1, 0.1)
        )
        plant = SimulatedPlant(Rod.preset(self.rod), sample_time=0.05, noise=1e-3)
        return Study(plant=plant, mpc=mpc, task=self.task, cost=Cost(Q=1e3, R=1.0, input_term="rate"))

    def __call__(self, theta: np.ndarray, repetition: int, number: int) -> float | None:
        study = self.study
        try:
            controller = study.mpc.controller(theta)
        except DesignError:
            return None
        seed = int(np.random.SeedSequence([repetition, number]).generate_state(1)[0])
        episode = fly(study.plant, controller, study.task, seed=seed, time_limit=study.time_limit)
        if episode.failure is not None:
            return None
        J = study.cost.score(episode, study.mpc.input_scale).J
        return J if np.isfinite(J) else None


def _problem(name: str, title: str, rod: str, task: Task, model: PredictionModel) -> Problem:
    return Problem(name, title, Space(model.entries), Flown(rod, task, model))


STUDIES = [
    _problem("circle", "circle, Modal", "paper", Circle(radius=0.05, period=20.0), Modal()),
    _problem("hanging", "hanging, to the origin, Modal", "hanging", Origin(tip=(-0.01, 0.04)), Modal()),
    _problem("circle-dense", "circle, Dense of order 3", "paper", Circle(radius=0.05, period=20.0), Dense(order=3)),
]
