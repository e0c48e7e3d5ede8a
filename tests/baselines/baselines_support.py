"""A linear robot of which everything is known, and what the methods are tried on."""

from math import inf

import numpy as np

from socasadi import Circle, LinearMPC, Modal, Rod, SimulatedPlant, Study

MODEL = Modal.from_spec(length=0.6, bending_stiffness=0.64, mass_per_length=2.8, cable_offset=0.02)
THETA = np.array([4.4, 0.1, 0.0056, -0.0028, -0.0028, 4.7, 0.08, 0.0, 0.0049, -0.0049])
"""frequency, damping ratio and gains of y, then of z"""
SYSTEM = MODEL.state_space(THETA, 0.05)


class LinearPlant:
    """A linear model as a robot."""

    sample_time, inputs, outputs = 0.05, 3, 2

    def __init__(self, noise: float = 0.0) -> None:
        self.noise = noise
        self.tension = np.zeros(3)

    def reset(self, tip=None, *, seed=None, tension_bounds=(-inf, inf)):
        self.random = np.random.default_rng(seed)
        self.x, self.y, self.tension = np.zeros(len(SYSTEM.A)), np.zeros(2), np.zeros(3)
        return self.measured()

    def step(self, tension, tip_force=None):
        self.tension = np.asarray(tension, dtype=float)
        self.x = SYSTEM.A @ self.x + SYSTEM.B @ self.tension
        self.y = SYSTEM.C @ self.x + SYSTEM.D @ self.tension
        return self.measured()

    def measured(self):
        return self.y + self.noise * self.random.standard_normal(2)

    @property
    def true_output(self):
        return self.y


def study(plant=None, duration=6.0, **mpc):
    """A short circle."""
    return Study(
        plant=plant or LinearPlant(),
        mpc=LinearMPC(MODEL, **mpc),
        task=Circle(radius=0.03, period=6.0, duration=duration),
        seed_points=4,
        iterations=4,
    )


def watched(lab):
    """The cost of each of the lab's flights from now on; infinite of those without."""
    costs, fly = [], lab.fly

    def flown(pilot, **given):
        episode = fly(pilot, **given)
        costs.append(np.inf if (J := lab.cost(episode)) is None else J)
        return episode

    lab.fly = flown
    return costs


def rod_study(**changes):
    return study(SimulatedPlant(Rod.preset("paper")), **changes)
