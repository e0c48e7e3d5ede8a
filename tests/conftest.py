import signal
from dataclasses import dataclass
from math import inf

import numpy as np
import pytest

from socasadi import Circle, LinearMPC, Modal, Study


def pytest_configure() -> None:
    # A shell that runs the tests in its background has Ctrl-C ignored, in them and in all that they start.
    signal.signal(signal.SIGINT, signal.default_int_handler)


class ToyPlant:
    """Two independent first-order lags: a robot that takes no time, for tests of what is around the robot."""

    sample_time, inputs, outputs = 0.05, 3, 2

    def __init__(self, noise: float = 1e-3) -> None:
        self.noise = noise
        self.tension = np.zeros(3)

    def reset(self, tip=None, *, seed=None, tension_bounds=(-inf, inf)):
        self.random = np.random.default_rng(seed)
        self.y = np.zeros(2) if tip is None else np.array(tip, dtype=float)
        self.tension = np.zeros(3)
        return self.measured()

    def step(self, tension, tip_force=None):
        self.tension = np.asarray(tension, dtype=float)
        force = np.zeros(2) if tip_force is None else np.asarray(tip_force)[1:]
        directions = np.array([[1.0, -0.5, -0.5], [0.0, 0.87, -0.87]])
        self.y = self.y + 0.2 * (0.005 * directions @ self.tension + 0.01 * force - self.y)
        return self.measured()

    def measured(self):
        return self.y + self.noise * self.random.standard_normal(2)

    @property
    def true_output(self):
        return self.y


@dataclass(frozen=True)
class ShortCircle(Circle):
    duration: float = 1.0
    period: float = 2.0


def make_toy_study():
    """A study of 12 trials of 20 samples that runs in a second or two."""
    return Study(
        plant=ToyPlant(), mpc=LinearMPC(Modal()), task=ShortCircle(), seed_points=6, iterations=6, verifications=1
    )


@pytest.fixture
def toy_study():
    return make_toy_study()
