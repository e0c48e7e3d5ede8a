"""What the found theta is worth without the luck of its trial, and which one is exported."""

import shutil
from dataclasses import replace
from math import inf
from pathlib import Path

import numpy as np
import pytest
from conftest import make_toy_study

from socasadi.campaign import (
    Campaign,
    Flight,
    Journal,
    MeasuredLimit,
    Result,
    RunError,
    assess,
    assessed,
    estimate_told,
)
from socasadi.plant import PlantFailure
from socasadi.tune import Estimate


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """The folder of a run that was assessed, and what came of it."""
    result = make_toy_study().run(tmp_path_factory.mktemp("whole") / "run", progress=None)
    assert assessed(result) == {}
    return result.folder, assess(result)


def copied(whole, study, tmp_path):
    folder, first = whole
    return Result(study, Path(shutil.copytree(folder, tmp_path / "run"))), first


def test_no_verification_is_flown_twice(whole, toy_study, tmp_path):
    result, first = copied(whole, toy_study, tmp_path)
    steps = []
    original = type(toy_study.plant).step
    counted = replace(toy_study, plant=toy_study.plant)
    toy_study.plant.step = lambda *a, **k: (steps.append(1), original(toy_study.plant, *a, **k))[1]
    second = assess(Result(counted, result.folder))
    assert not steps
    np.testing.assert_array_equal(first.verdicts["best"].J, second.verdicts["best"].J)


def test_what_was_assessed_is_read_again_without_flying(whole, toy_study, tmp_path):
    result, _ = copied(whole, toy_study, tmp_path)
    worst = max(result.trials, key=lambda trial: trial.J or 0.0)
    rivals = {"rival": worst.theta, "stranger": 0.9 * result.best.theta}
    first = assess(result, rivals).verdicts
    read = assessed(Result(toy_study, tmp_path / "run"))
    assert {f"trial {result.best.number}", f"trial {worst.number}", "stranger", "identified"} <= set(read)
    assert {verdict.theta.tobytes() for verdict in read.values()} == {one.theta.tobytes() for one in first.values()}
    for verdict in read.values():
        (same,) = [one for one in first.values() if np.array_equal(one.theta, verdict.theta)]
        for value in ("J", "rmse", "failed", "broken", "prediction_error"):
            np.testing.assert_array_equal(getattr(verdict, value), getattr(same, value))
    # One that was assessed before is still itself, and keeps all its flights.
    assess(result, {"rival": result.trials[0].theta})
    more = replace(toy_study, verifications=toy_study.verifications + 1)
    assess(Result(more, result.folder), rivals)
    again = assessed(Result(more, result.folder))
    assert len(again[f"trial {worst.number}"].J) == more.verifications
    assert "trial 1" in again


def test_a_plant_that_cannot_be_probed_still_has_its_best_theta_verified(toy_study, tmp_path):
    class Tired(type(toy_study.plant)):
        def reset(self, tip=None, *, seed=None, tension_bounds=(-inf, inf)):
            self.steps = 0
            return super().reset(tip, seed=seed)

        def step(self, tension, tip_force=None):
            self.steps += 1
            if self.steps > 50:
                raise PlantFailure("the battery is empty")
            return super().step(tension, tip_force)

    result = replace(toy_study, plant=Tired()).run(tmp_path / "run", progress=None)
    assessment = assess(result)
    assert set(assessment.verdicts) <= {"best", "best estimated"}
    assert np.isnan(assessment.verdicts["best"].prediction_error)
    assert assessment.unidentified == "PlantFailure: the battery is empty"


def test_the_identified_theta_predicts_no_worse_than_the_tuned_one(whole):
    verdicts = whole[1].verdicts
    assert verdicts["identified"].prediction_error <= 1.05 * verdicts["best"].prediction_error


def test_the_best_that_is_estimated_is_flown_beside_the_best_observed_and_the_better_is_exported(toy_study, tmp_path):
    noisy = replace(toy_study, plant=type(toy_study.plant)(noise=0.02), verifications=3)
    result = noisy.run(tmp_path / "run", progress=None)
    verdicts = assess(result).verdicts
    estimate = result.best_estimated
    assert estimate.low <= estimate.cost <= estimate.high
    trial = result.trials[estimate.index]
    assert trial.theta.tolist() == estimate.theta.tolist()
    rivals = [verdicts[name] for name in ("best", "best estimated") if name in verdicts]
    assert len(rivals) == 1 + (trial.number != result.best.number)
    better = min(rivals, key=lambda verdict: verdict.J.mean())
    assert result.chosen.theta.tolist() == better.theta.tolist()
    assert any(f"trial {result.chosen.number} of 12" in line for line in result.controller_record().provenance)


@pytest.mark.parametrize(
    ("low", "high", "known"),
    [(1.1, 1.6, True), (1.2, 1.2, True), (-0.1, 0.4, False), (0.0, 0.4, False), (0.5, 1.5, False)],
)
def test_an_estimate_that_says_nothing_is_not_told(told, low, high, known):
    result, *_ = told  # of the costs 1, 2, 3, whose standard deviation is 0.8
    estimate = Estimate(0, result.trials[0].theta, 1.2, low, high)
    expected = ("1.2", f"90 %: {low:.4g} to {high:.4g}")
    nothing = ("", "too few trials to say what the best is worth without noise")
    assert estimate_told(estimate, result.trials) == (expected if known else nothing)


@pytest.fixture
def told(toy_study, tmp_path):
    """A run whose trial 1 was told the least J, and a way to add flights of its trials."""
    study = replace(toy_study, seed_points=3, iterations=0)
    episode = study.run(tmp_path / "flown", progress=None).episode(1)
    with Campaign(study, tmp_path / "run") as campaign:
        for cost in (1.0, 2.0, 3.0):
            campaign.tell(campaign.ask().number, cost=cost)
    result = Result(study, tmp_path / "run")
    score = study.cost.score(episode, study.mpc.input_scale)

    def fly(number, *costs):
        with Journal(result.folder / "journal.sqlite", writer=True) as journal:
            for i, J in enumerate(costs):
                flight = Flight(f"{number} {i}", result.trials[number - 1].theta, J and replace(score, J=J), episode)
                journal.add_flight(flight)

    return result, fly


@pytest.mark.parametrize(
    ("flights", "chosen"),
    [
        ({}, 1),
        ({1: (5.0, 5.0)}, 1),
        ({1: (5.0, 5.0), 2: (4.0, 4.5)}, 2),
        ({1: (5.0, 5.0), 2: (1.0, None)}, 1),
        ({1: (5.0, None), 2: (9.0, 9.0)}, 2),
        ({2: (0.5,)}, 1),
    ],
)
def test_of_those_flown_again_the_one_of_least_mean_J_is_exported(told, flights, chosen):
    result, fly = told
    for number, costs in flights.items():
        fly(number, *costs)
    assert result.best.number == 1
    assert result.chosen.number == chosen


def test_a_controller_whose_J_was_told_alone_is_exported_with_an_episode_on_its_own_model(told, tmp_path):
    result, _ = told
    record = result.controller_record()
    assert record.provenance[0] == "trial 1 of 3, J = 1.0"
    assert len(record.output) == 200
    result.export(tmp_path / "c")
    assert (tmp_path / "c" / "controller.h").exists()


def test_what_breaks_a_limit_when_it_is_flown_again_is_not_what_is_exported(toy_study, tmp_path):
    calls = []

    def luck(episode, mpc):
        """The search's trials keep the limit; of the flights beside it, those of the best observed do not."""
        calls.append(1)
        return float(episode.output[1, 0] == broken[0]) if broken else 0.0

    broken = []
    noisy = replace(toy_study, plant=type(toy_study.plant)(noise=0.02), verifications=1)
    study = replace(noisy, limits=(MeasuredLimit("luck", "1", 0.5, luck),))
    result = study.run(tmp_path / "run", progress=None)
    verdicts = assess(result).verdicts
    assert verdicts["best"].broken == 0
    (flight,) = [f for name, f in result.flights().items() if name.startswith("best ") and "estimated" not in name]
    broken.append(flight.episode.output[1, 0])
    again = Result(study, result.folder)
    assert assess(again).verdicts["best"].broken == 1
    if "best estimated" in verdicts:
        assert again.chosen.theta.tolist() == verdicts["best estimated"].theta.tolist()


def test_a_limit_that_nothing_keeps_is_named_with_how_near_it_came(toy_study, tmp_path):
    study = replace(toy_study, limits=(MeasuredLimit("load", "N", -1.0, lambda episode, mpc: 2.0),), iterations=0)
    result = study.run(tmp_path / "run", progress=None)
    with pytest.raises(RunError, match=r"none of the 6 trials .* load was 2 N at least, above its limit of -1"):
        _ = result.best
