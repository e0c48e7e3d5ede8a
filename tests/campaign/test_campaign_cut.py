"""A hopeless episode is cut, and what its record proves is true of the whole."""

from dataclasses import replace

import numpy as np
import pytest

from socasadi import Cost
from socasadi.campaign import fly

THETA = [9.0, 0.7, 0.005, -0.0025, -0.0025, 9.0, 0.7, 0.0, 0.00435, -0.00435]
TERMS = ("rate", "normalised", "literal")


def flown(study, cost=None, **settings):
    controller = study.mpc.controller(THETA)
    return fly(study.plant, controller, study.task, seed=3, time_limit=60.0, cost=cost or study.cost, **settings)


@pytest.mark.parametrize("term", TERMS)
def test_the_running_cost_never_falls_and_ends_at_j_to_the_last_bit(toy_study, term):
    cost = Cost(Q=((900.0, 20.0), (20.0, 1100.0)), R=(0.3, 1.0, 2.0), input_term=term)
    study = replace(toy_study, task=replace(toy_study.task, duration=4.0))
    episode, scale = flown(study), study.mpc.input_scale
    running = cost.running(episode, scale)
    assert len(running) == 80
    assert (np.diff(running) >= 0).all()
    assert running[-1] == cost.score(episode, scale).J


@pytest.mark.parametrize("term", TERMS)
def test_an_episode_is_cut_at_the_first_sample_that_proves_too_much(toy_study, term):
    cost = Cost(Q=1e3, R=1.0, input_term=term)
    scale = toy_study.mpc.input_scale
    whole = flown(toy_study, cost)
    running = cost.running(whole, scale)
    give_up = float(running[11]) * (1 - 1e-12)
    cut = flown(toy_study, cost, give_up=give_up)
    assert cut.failure is None
    assert len(cut.tension) == 12
    assert cut.cut == running[11]
    assert cut.cut == cost.running(cut, scale)[-1]
    assert give_up < cut.cut <= cost.score(whole, scale).J
    for name in ("output", "reference", "truth", "tension"):
        part = getattr(cut, name)
        np.testing.assert_array_equal(part, getattr(whole, name)[: len(part)])


def test_an_episode_that_proves_no_more_than_the_threshold_is_flown_to_its_end(toy_study):
    J = toy_study.cost.score(flown(toy_study), toy_study.mpc.input_scale).J
    episode = flown(toy_study, give_up=J)
    assert episode.cut is None
    assert len(episode.tension) == 20


def test_what_is_only_proven_by_the_last_sample_is_a_whole_episode(toy_study):
    running = toy_study.cost.running(flown(toy_study), toy_study.mpc.input_scale)
    episode = flown(toy_study, give_up=float(running[-2]))
    assert running[-2] < running[-1]
    assert episode.cut is None
    assert len(episode.tension) == 20


def test_what_was_held_before_counts_as_in_the_score(toy_study):
    class Held(type(toy_study.plant)):
        def reset(self, tip=None, **settings):
            y = super().reset(tip, **settings)
            self.tension = np.array([4.0, 0.0, -2.0])
            return y

    study = replace(toy_study, plant=Held())
    episode = flown(study)
    assert flown(study, give_up=0.0).cut == study.cost.running(episode, study.mpc.input_scale)[0]


@pytest.mark.parametrize("value", [np.nan, np.inf, 1e200])
def test_outputs_whose_cost_is_no_number_are_a_failure_and_never_a_cut(toy_study, tmp_path, value):
    class Blind(type(toy_study.plant)):
        def step(self, tension, tip_force=None):
            return np.full(2, value)

    study = replace(toy_study, plant=Blind(), seed_points=1, iterations=0)
    assert flown(study, give_up=1.0).cut is None
    (trial,) = study.run(tmp_path / "run", progress=None).trials
    assert trial.outcome == "failed"
    assert "finite" in trial.failure


def test_a_threshold_needs_the_cost_that_it_is_of(toy_study):
    with pytest.raises(ValueError, match=r"give_up=3\.0 is a value of J: give the cost"):
        fly(toy_study.plant, toy_study.mpc.controller(THETA), toy_study.task, seed=0, time_limit=1.0, give_up=3.0)


@pytest.mark.parametrize("weights", [{"Q": -1.0}, {"R": ((1.0, 0, 0), (0, -1.0, 0), (0, 0, 1.0))}])
def test_weights_under_which_nothing_is_proven_are_refused(toy_study, weights):
    with pytest.raises(ValueError, match="must be positive semidefinite"):
        replace(toy_study, cost=Cost(**weights))


def test_a_campaign_cuts_nothing_that_could_have_become_the_best(toy_study, tmp_path):
    thrifty = replace(toy_study, search="sobol", seed_points=24, iterations=0, give_up=1.5)
    cut = thrifty.run(tmp_path / "cut", progress=None)
    whole = replace(thrifty, give_up=None).run(tmp_path / "whole", progress=None)
    best = np.inf
    for mine, flown in zip(cut.trials, whole.trials, strict=True):
        np.testing.assert_array_equal(mine.theta, flown.theta)
        if mine.outcome == "cut":
            assert 1.5 * best < mine.at_least <= flown.J
            assert mine.saved_seconds == pytest.approx(1.0 - mine.plant_seconds)
        else:
            assert mine.J == flown.J
            best = min(best, mine.J)
    assert any(trial.outcome == "cut" for trial in cut.trials)
    assert cut.best.number == whole.best.number
    assert cut.plant_seconds + cut.saved_seconds == pytest.approx(whole.plant_seconds)
