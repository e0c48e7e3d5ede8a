"""Limits beside J say of an episode what a ruler and a clock would say."""

from dataclasses import replace
from math import inf

import numpy as np
import pytest

from socasadi import LinearMPC, Modal
from socasadi.campaign import Episode, MeasuredLimit, Overshoot, SettlingTime, Study, ViolatedOutputs

MPC = LinearMPC(Modal())


def episode(truth, reference, sample_time=0.1):
    truth = np.asarray(truth, float)
    reference = np.broadcast_to(np.asarray(reference, float), truth.shape)
    return Episode(
        sample_time=sample_time,
        output=truth + 7.0,  # limits are about where the robot was, not about what a noisy sensor said
        reference=reference,
        truth=truth,
        tension=np.zeros((len(truth) - 1, 3)),
        held=np.zeros(3),
        shapes=np.zeros((0, 0, 3)),
    )


def test_overshoot_is_how_far_the_robot_goes_past_its_goal_along_the_way_to_it():
    towards = np.array([0.6, 0.8])
    way = np.array([0.0, 0.03, 0.054, 0.047, 0.051])[:, None] * towards
    goal = 0.05 * towards
    assert Overshoot(1.0).measure(episode(way, goal), MPC) == pytest.approx(0.004)
    aside = way + 0.02 * np.array([-0.8, 0.6]) * (np.arange(5) > 0)[:, None]
    assert Overshoot(1.0).measure(episode(aside, goal), MPC) == pytest.approx(0.004)
    assert Overshoot(1.0).measure(episode(way[:2], goal), MPC) == 0.0


def test_a_task_that_starts_where_it_wants_to_be_has_no_overshoot():
    wander = [[0, 0], [0.01, 0], [-0.02, 0.01]]
    assert Overshoot(1.0).measure(episode(wander, [0, 0]), MPC) == 0.0


def test_a_sample_counts_as_violated_when_any_output_is_outside_its_bounds():
    truth = [[9, 9], [0.05, 0.0], [0.11, 0.0], [0.0, -0.2], [0.11, 0.2]]
    assert ViolatedOutputs(0.1).measure(episode(truth, [0, 0]), MPC) == pytest.approx(3 / 4)
    narrow = replace(MPC, output_bounds=((-inf, -0.1), (0.01, 0.1)))
    assert ViolatedOutputs(0.1).measure(episode([[0, 0], [-5.0, 0], [0.02, 0]], [0, 0]), narrow) == pytest.approx(0.5)


@pytest.mark.parametrize(
    ("distances", "settled"),
    [([0.05, 0.02, 0.003, 0.002, 0.001], 0.2), ([0.05, 0.002, 0.006, 0.002, 0.001], 0.3), ([0.001] * 5, 0.0)],
)
def test_settling_time_is_when_the_band_is_entered_for_good(distances, settled):
    truth = np.outer(distances, [0.6, 0.8])
    assert SettlingTime(1.0, band=0.005).measure(episode(truth, [0, 0]), MPC) == pytest.approx(settled)


def test_what_never_settles_takes_longer_than_the_episode():
    assert SettlingTime(1.0, band=0.005).measure(episode(np.full((5, 2), 0.1), [0, 0]), MPC) == pytest.approx(0.5)


def test_a_limit_of_ones_own_is_a_function(toy_study, tmp_path):
    pull = MeasuredLimit("pull", "N", 5.0, lambda episode, mpc: float(np.abs(episode.tension).max()))
    study = replace(toy_study, limits=(Overshoot(0.01), pull), iterations=0)
    result = study.run(tmp_path / "run", progress=None)
    for trial in result.trials:
        assert trial.measured["pull"] == np.abs(result.episode(trial.number).tension).max()
        assert trial.measured["overshoot"] == Overshoot(0.01).measure(result.episode(trial.number), study.mpc)


def test_limits_survive_the_run_folder(toy_study):
    limits = (Overshoot(0.01), SettlingTime(0.5, band=0.004), ViolatedOutputs(0.0))
    from socasadi import Circle

    study = replace(toy_study, limits=limits, task=Circle())
    assert Study.from_settings(study.settings).limits == limits


@pytest.mark.parametrize(
    ("make", "error", "words"),
    [
        (lambda s: Overshoot(-0.001), ValueError, "limit of Overshoot must be finite and not negative, not -0.001 m"),
        (lambda s: SettlingTime(1.0, band=inf), ValueError, "band of SettlingTime must be finite"),
        (lambda s: replace(s, limits=(Overshoot(0.1), Overshoot(0.2))), ValueError, "two limits .* called 'overshoot'"),
        (lambda s: replace(s, limits=(Overshoot,)), TypeError, "a limit has name, unit, limit and measure"),
        (lambda s: replace(s, limits=(0.1,)), TypeError, "a limit has name, unit, limit and measure"),
        (
            lambda s: replace(s, mpc=replace(MPC, output_bounds=None), limits=(ViolatedOutputs(0.1),)),
            ValueError,
            "this MPC has none",
        ),
        (lambda s: MeasuredLimit("pull", "N", 5.0, 3), TypeError, "function of MeasuredLimit"),  # pyright: ignore
    ],
)
def test_nonsense_is_refused_in_a_sentence(toy_study, make, error, words):
    with pytest.raises(error, match=words):
        make(toy_study)


def test_a_limit_that_is_no_number_fails_its_trial_with_its_name(toy_study, tmp_path):
    silly = MeasuredLimit("silly", "m", 1.0, lambda episode, mpc: float("nan"))
    study = replace(toy_study, limits=(silly,), seed_points=1, iterations=0)
    (trial,) = study.run(tmp_path / "run", progress=None).trials
    assert trial.outcome == "failed"
    assert "silly was measured to be nan m, no finite number" in trial.failure
