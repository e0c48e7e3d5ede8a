"""What a controller is worth is what it does, flight by flight, under noise that it has not seen."""

import time
from dataclasses import replace
from math import inf

import numpy as np
import pytest
from baselines_support import THETA, LinearPlant, rod_study, study

from socasadi import SetPoints
from socasadi.baselines import DeadCable, Lab, Law, Linearised, worth, worth_elsewhere
from socasadi.baselines.comparison._judge import open_loop_error
from socasadi.campaign import Stream, fly_once

TIMES = 0.05 * np.arange(1, 121)
WANTED = np.array([0.01, 0.0])


class OnRails:
    """Its true output moves on a given path (T, 2), whatever the inputs are."""

    sample_time, inputs, outputs = 0.05, 3, 2

    def __init__(self, path, noise=0.0):
        self.path, self.noise, self.tension = np.vstack([np.zeros(2), path]), noise, np.zeros(3)

    def reset(self, tip=None, *, seed=None, tension_bounds=(-inf, inf)):
        self.random, self.at, self.tension = np.random.default_rng(seed), 0, np.zeros(3)
        return self.measured()

    def step(self, tension, tip_force=None):
        self.at, self.tension = self.at + 1, np.asarray(tension, dtype=float)
        return self.measured()

    @property
    def true_output(self):
        return self.path[self.at]

    def measured(self):
        return self.true_output + self.noise * self.random.standard_normal(2)


class Holding(Law):
    """Always the same inputs; one step in twenty takes its time."""

    def begin(self):
        self.steps = 0

    def act(self, y, reference):
        self.steps += 1
        if self.steps % 20 == 0:
            time.sleep(0.02)
        return np.array([3.0, -4.0, 0.0])


def flown(path, noise=0.0, flights=1):
    made = study(OnRails(path, noise), output_bounds=(-0.015, 0.015))
    made = replace(made, task=SetPoints(points=(tuple(WANTED),), hold=6.0, duration=6.0))
    return worth(made, Holding(made.mpc), flights), made


def test_the_numbers_of_a_flight_are_those_of_its_path():
    path = np.full((120, 2), WANTED)
    path[30:60] += [0.006, 0.0]  # beyond the bound for a quarter of the time
    path[90:] += [0.0, 0.003]  # 3 mm beside it in the last quarter
    (told, seen), _ = flown(path)
    np.testing.assert_allclose(seen[1:], path)
    assert told.settled == pytest.approx(3e-3)
    assert told.violated == pytest.approx(30 / 121)
    assert told.effort == pytest.approx(np.sqrt((0.3**2 + 0.4**2) / 3))
    # J by hand: 1e3 times squared distances, and the one change of inputs, from rest, as shares of 10 N.
    assert told.J[0] == pytest.approx(1e3 * np.sum((path - WANTED) ** 2) + 0.3**2 + 0.4**2)
    assert told.failed == told.fallbacks == 0
    assert told.failure is None


def test_the_time_of_a_step_is_told_as_it_is_typically_rarely_and_at_most():
    (told, _), _ = flown(np.zeros((120, 2)))
    median, rare, longest = told.solve
    assert median < 0.005 < 0.02 <= rare <= longest


def test_each_flight_has_noise_of_its_own_which_no_trial_had():
    (told, _), made = flown(np.full((120, 2), WANTED), noise=1e-3, flights=4)
    trials = [Lab(made, (1e3,)).fly(Holding(made.mpc), number=number) for number in range(1, 5)]
    tuned_on = [Lab(made, (1e3,)).cost(trial) for trial in trials]
    assert len({*told.J, *tuned_on}) == 8
    # 240 measurements that are 1 mm off, and the inputs.
    assert np.mean(told.J) == pytest.approx(0.25 + 0.24, rel=0.1)


def test_one_that_fails_is_infinite_and_says_why():
    class Torn(OnRails):
        def step(self, tension, tip_force=None):
            raise RuntimeError("a cable tore")

    made = study(Torn(np.zeros((120, 2))))
    told, _ = worth(made, Holding(made.mpc), 2)
    assert np.isinf(told.J).all()
    assert told.failed == 2
    assert "a cable tore" in (told.failure or "")


def test_elsewhere_is_on_the_other_robot():
    made = study()
    pilot = made.mpc.controller(THETA)
    (dead,) = worth_elsewhere(made, pilot, 1, {"dead": DeadCable(0)}).values()
    own, there = (worth(s, pilot, 1)[0] for s in (made, replace(made, plant=DeadCable(0)(made.plant))))
    assert dead.J == there.J
    assert dead.J[0] > 1.5 * own.J[0]


def test_the_open_loop_error_is_that_of_the_model_in_the_controller():
    made = study()
    assert open_loop_error(made, made.mpc.controller(THETA)) < 1e-9
    half = THETA * np.where(np.arange(10) % 5 >= 2, 0.5, 1.0)  # gains
    record = Lab(replace(made, plant=LinearPlant()), (1e3,)).probe(20.0, hold=0.5)
    size = np.sqrt(np.mean(np.sum(record.output[1:] ** 2, axis=1)))
    assert open_loop_error(made, made.mpc.controller(half)) == pytest.approx(size / 2, rel=0.3)
    assert np.isnan(open_loop_error(made, Holding(made.mpc)))


def test_what_a_rod_is_linearised_for_is_what_is_known_of_it():
    """A rod that differs from the known one is flown with a model of the known one."""
    made, other = rod_study(), rod_study()
    soft = replace(other.plant.rod, material=replace(other.plant.rod.divisions[0].material, young=5e4))
    (known,) = Linearised().offers(Lab(replace(made, plant=replace_rod(other.plant, soft)), (6.0,), known=made.plant))
    (own,) = Linearised().offers(Lab(made, (6.0,)))
    np.testing.assert_array_equal(known.design.A, own.design.A)


def replace_rod(plant, rod):
    return type(plant)(rod, plant.sample_time)


def test_flights_of_the_judge_are_those_of_a_campaigns_verification():
    made = study(LinearPlant(noise=1e-3))
    pilot = made.mpc.controller(THETA)
    told, path = worth(made, pilot, 1)
    episode = fly_once(made, pilot, (Stream.VERIFICATION, 1))
    np.testing.assert_array_equal(path, episode.truth)
    assert told.J[0] == pytest.approx(made.cost.score(episode, made.mpc.input_scale).J)
