"""Asking and telling from outside: an experiment by hand takes the place of a flown one, days apart."""

import os
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from socasadi import Circle, Study
from socasadi.campaign import Campaign, Journal, JournalError, Overshoot, Result, RunError, assess, fly
from socasadi.plant import ExternalPlant, ExternalPlantError


def flown(study, asked):
    """What a person brings back: the robot's record of a trial."""
    seed = int(np.random.SeedSequence([study.seed, 0, asked.number]).generate_state(1)[0])
    controller = study.mpc.controller(asked.theta)
    settings = {"seed": seed, "time_limit": 60.0, "give_up": asked.give_up, "cost": study.cost}
    return fly(study.plant, controller, study.task, **settings)


def tell_next(campaign, cost):
    return campaign.tell(campaign.ask().number, cost=cost)


def test_asked_and_told_one_by_one_from_reopened_folders_it_is_the_run_that_flies_itself(toy_study, tmp_path):
    study = replace(toy_study, task=Circle(duration=1.0, period=2.0), iterations=3)
    run = study.run(tmp_path / "run", progress=None)
    for number in range(1, 10):
        with Campaign(study, tmp_path / "hand", resume=True) as campaign:
            asked = campaign.ask()
        with Campaign.open(tmp_path / "hand") as campaign:
            assert [out.number for out in campaign.pending] == [asked.number] == [number]
            campaign.tell(number, episode=flown(study, asked))
    by_hand = Result.open(tmp_path / "hand")
    assert by_hand.complete
    for ours, theirs in zip(by_hand.trials, run.trials, strict=True):
        assert ours.theta.tolist() == theirs.theta.tolist()
        assert (ours.J, ours.at_least, ours.outcome, ours.score) == (
            theirs.J,
            theirs.at_least,
            theirs.outcome,
            theirs.score,
        )
    assert by_hand.plant_seconds == run.plant_seconds
    assert by_hand.episode(2).output.tolist() == run.episode(2).output.tolist()


def test_what_is_out_is_reckoned_with_and_comes_back_the_same(toy_study, tmp_path):
    with Campaign(toy_study, tmp_path / "run") as campaign:
        asked = [campaign.ask() for _ in range(3)]
        campaign.tell(2, cost=5.0)
    assert len({tuple(one.theta) for one in asked}) == 3
    with Campaign(toy_study, tmp_path / "run", resume=True) as campaign:
        assert [out.number for out in campaign.pending] == [1, 3]
        for out, before in zip(campaign.pending, (asked[0], asked[2]), strict=True):
            assert out.theta.tolist() == before.theta.tolist()
            assert (out.give_up, out.asked, out.started) == (before.give_up, before.asked, before.started)
        assert campaign.ask().number == 4


class TestTakingBack:
    """A wrong number was told: the trial is out again, and the search goes on as if it had never heard of it."""

    def test_told_anew_it_is_the_campaign_that_was_never_told_wrong(self, toy_study, tmp_path):
        with Campaign(toy_study, tmp_path / "right") as campaign:
            right = [tell_next(campaign, 5.0 + number) for number in range(8)]
            expected = campaign.ask().theta
        with Campaign(toy_study, tmp_path / "wrong") as campaign:
            for number in range(7):
                tell_next(campaign, 5.0 + number)
            last = tell_next(campaign, 0.001)
            assert campaign.best is last
            assert campaign.take_back(8).J == 0.001
            assert campaign.best.number == 1
            assert [out.number for out in campaign.pending] == [8]
            assert campaign.pending[0].theta.tolist() == right[-1].theta.tolist()
        with Campaign(toy_study, tmp_path / "wrong", resume=True) as campaign:
            assert [out.number for out in campaign.pending] == [8]
            campaign.tell(8, cost=12.0)
            assert campaign.ask().theta.tolist() == expected.tolist()

    def test_the_journal_keeps_what_was_told_and_when(self, toy_study, tmp_path):
        with Campaign(toy_study, tmp_path / "run") as campaign:
            one, two = campaign.ask(), campaign.ask()
            campaign.tell(1, episode=flown(toy_study, one))
            wrong = campaign.take_back(1)
            campaign.tell(two.number, cost=3.0)
            again = campaign.tell(1, cost=4.0)
        with Journal(tmp_path / "run" / "journal.sqlite") as journal:
            ((event, kept),) = journal.taken_back()
            assert (event, kept.told, again.told) == (4, 3, 6)
            assert (kept.J, kept.score, kept.theta.tolist()) == (wrong.J, wrong.score, wrong.theta.tolist())
            assert [trial.J for trial in journal.trials()] == [3.0, 4.0]
            assert journal.episode(1) is None

    def test_a_trial_that_a_run_flew_is_flown_again_by_the_next(self, toy_study, tmp_path):
        study = replace(toy_study, iterations=0)
        before = study.run(tmp_path / "run", progress=None)
        with Campaign(study, tmp_path / "run", resume=True) as campaign:
            campaign.take_back(3)
            assert not campaign.complete
        after = study.run(tmp_path / "run", resume=True, progress=None)
        assert {trial.number: trial.J for trial in after.trials} == {trial.number: trial.J for trial in before.trials}

    def test_what_was_not_told_cannot_be_taken_back(self, toy_study, tmp_path):
        with Campaign(toy_study, tmp_path / "run") as campaign:
            tell_next(campaign, 5.0)
            campaign.ask()
            for number in (0, 2, 3):
                with pytest.raises(RunError, match=f"nothing was told of trial {number} of .*; told: 1"):
                    campaign.take_back(number)


def test_an_ask_is_stored_before_it_is_handed_out(toy_study, tmp_path):
    """Another program can read it from the journal at once."""
    with Campaign(toy_study, tmp_path / "run") as campaign:
        theta = campaign.ask().theta
        code = (
            "import json, sqlite3, sys; "
            "print(*sqlite3.connect(sys.argv[1]).execute('SELECT theta FROM trial').fetchone())"
        )
        command = [sys.executable, "-c", code, str(tmp_path / "run" / "journal.sqlite")]
        seen = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    assert seen.strip() == str(theta.tolist())


class TestOutcomes:
    @pytest.fixture
    def campaign(self, toy_study, tmp_path):
        with Campaign(toy_study, tmp_path / "run") as campaign:
            campaign.ask()
            yield campaign

    def test_a_cost_from_elsewhere(self, campaign):
        trial = campaign.tell(1, cost=7)
        assert (trial.outcome, trial.J, trial.score, trial.plant_seconds) == ("done", 7.0, None, None)
        assert campaign.best is trial

    def test_a_failure_with_its_reason(self, campaign):
        trial = campaign.tell(1, failed="the cable slipped")
        assert (trial.outcome, trial.J, trial.failure) == ("failed", None, "the cable slipped")
        assert campaign.best is None

    def test_a_record_that_ends_in_a_failure(self, campaign, toy_study):
        episode = flown(toy_study, campaign.pending[0])
        broken = replace(episode, output=episode.output[:6], tension=episode.tension[:5], failure="a hose burst")
        trial = campaign.tell(1, episode=broken)
        assert (trial.outcome, trial.failure) == ("failed", "a hose burst")
        assert trial.plant_seconds == pytest.approx(0.25)

    def test_a_record_that_was_cut_is_a_bound(self, campaign, toy_study):
        episode = flown(toy_study, campaign.pending[0])
        trial = campaign.tell(1, episode=replace(episode, tension=episode.tension[:5], cut=12.5))
        assert (trial.outcome, trial.J, trial.at_least) == ("cut", None, 12.5)
        assert trial.plant_seconds == pytest.approx(0.25)
        assert trial.saved_seconds == pytest.approx(0.75)
        assert trial.failure == "J is above 12.5 after 0.25 s"

    @pytest.mark.parametrize(
        ("number", "told", "words"),
        [
            (2, {"cost": 1.0}, "trial 2 of .* was never asked; not told yet: 1"),
            (1, {}, "trial 1 is told by exactly one of an episode, a cost and a reason"),
            (1, {"cost": 1.0, "failed": "no"}, "exactly one of"),
            (1, {"cost": float("nan")}, "the cost is nan: it must be finite"),
            (1, {"cost": -1.0}, "the cost -1.0 is negative"),
        ],
    )
    def test_what_cannot_be_told_is_refused_and_nothing_is_stored(self, campaign, number, told, words):
        with pytest.raises((RunError, ValueError), match=words):
            campaign.tell(number, **told)
        assert [asked.number for asked in campaign.pending] == [1]
        with Journal(campaign.folder / "journal.sqlite") as journal:
            assert not journal.trials()
        assert campaign.tell(1, cost=1.0).J == 1.0

    def test_a_trial_is_told_once(self, campaign):
        campaign.tell(1, cost=1.0)
        with pytest.raises(RunError, match=r"trial 1 of .* was told already; not told yet: none"):
            campaign.tell(1, cost=1.0)


def test_when_all_are_asked_no_more_are(toy_study, tmp_path):
    with Campaign(replace(toy_study, seed_points=2, iterations=0), tmp_path / "run") as campaign:
        campaign.ask()
        campaign.ask()
        with pytest.raises(
            RunError, match=r"all 2 trials of .* were asked, 2 of them are out; ask for more iterations"
        ):
            campaign.ask()


def test_a_limit_must_be_measured(toy_study, tmp_path):
    study = replace(toy_study, limits=(Overshoot(0.5),))
    with Campaign(study, tmp_path / "run") as campaign:
        asked = campaign.ask()
        with pytest.raises(RunError, match="cannot be told by its cost alone, since the study limits overshoot"):
            campaign.tell(1, cost=4.0)
        trial = campaign.tell(1, cost=4.0, measured={"overshoot": 0.7})
        assert trial.measured == {"overshoot": 0.7}
        assert campaign.best is None
        asked = campaign.ask()
        assert asked.give_up is None
        assert campaign.tell(2, episode=flown(study, asked)).measured["overshoot"] < 0.5
        assert campaign.best.number == 2


def test_trials_that_broke_a_limit_are_never_the_best(toy_study, tmp_path):
    free = toy_study.run(tmp_path / "free", progress=None)
    with Journal(tmp_path / "free" / "journal.sqlite") as journal:
        least = Overshoot(1.0).measure(journal.episode(free.best.number), toy_study.mpc)
    study = replace(toy_study, limits=(Overshoot(0.9 * least),))
    bound = study.run(tmp_path / "bound", progress=None)
    assert min(trial.J for trial in free.trials if trial.J) == free.best.J
    kept = [trial for trial in bound.trials if trial.J and trial.measured["overshoot"] <= 0.9 * least]
    assert len(kept) < len([trial for trial in bound.trials if trial.J])
    if kept:
        assert min(trial.J for trial in kept) == bound.best.J
    else:
        with pytest.raises(RunError, match="a limit was not kept"):
            _ = bound.best


class TestAbsentRobot:
    @pytest.fixture
    def study(self, toy_study):
        plant = ExternalPlant(sample_time=0.05, inputs=3, outputs=2, name="the arm")
        return Study(plant=plant, mpc=toy_study.mpc, task=Circle(duration=1.0), seed_points=3, iterations=0)

    def test_a_robot_that_python_never_touches_has_a_campaign(self, study, tmp_path):
        with Campaign(study, tmp_path / "run") as campaign:
            for cost in (3.0, 1.0, 2.0):
                campaign.tell(campaign.ask().number, cost=cost)
            assert campaign.complete
        result = Result.open(tmp_path / "run")
        assert result.best.J == 1.0
        with pytest.raises(ExternalPlantError, match="the arm cannot be flown from here"):
            assess(result)
        assert not result.flights()

    def test_but_no_run(self, study, tmp_path):
        with pytest.raises(ExternalPlantError, match="the arm cannot be flown from here"):
            study.run(tmp_path / "run", jobs=2)
        assert not (tmp_path / "run").exists()


def test_while_somebody_asks_nobody_else_can(toy_study, tmp_path):
    with (
        Campaign(toy_study, tmp_path / "run"),
        pytest.raises(JournalError, match=f"is being written by process {os.getpid()}"),
    ):
        Campaign(toy_study, tmp_path / "run", resume=True)


class TestStartPoints:
    def test_they_are_asked_first_and_count_among_the_seed_points(self, toy_study, tmp_path):
        theta = [(entry.lower + entry.upper) / 2 for entry in toy_study.mpc.model.entries]
        study = replace(toy_study, initial=[np.array(theta)], seed_points=3, iterations=0)
        result = study.run(tmp_path / "run", progress=None)
        assert result.trials[0].theta.tolist() == theta
        assert len(result.trials) == 3
        assert study == Study(**vars(study))
        assert study.sobol_only().run(tmp_path / "sobol", progress=None).trials[0].theta.tolist() != theta

    @pytest.mark.parametrize(
        ("changes", "words"),
        [
            ({"initial": [[1.0]]}, r"theta has shape \(1,\)"),
            ({"initial": [[100.0] * 10]}, "outside its bounds"),
            ({"initial": [[3.0] * 10], "search": "sobol"}, "has points of its own to start with"),
            ({"search": "paper", "limits": (Overshoot(0.1),)}, "knows neither limits nor conditions"),
            ({"give_up": 0.5}, "give_up is a number of at least 1, or None, not 0.5"),
            ({"limits": (Overshoot(0.1), Overshoot(0.2))}, "overshoot"),
        ],
    )
    def test_settings_of_the_search_are_checked(self, toy_study, changes, words):
        with pytest.raises(ValueError, match=words):
            replace(toy_study, **changes)


def test_cutting_saves_the_robots_time_and_changes_no_J(toy_study, tmp_path):
    whole = replace(toy_study, give_up=None, iterations=0).run(tmp_path / "whole", progress=None)
    cut = replace(toy_study, give_up=3.0, iterations=0).run(tmp_path / "cut", progress=None)
    assert whole.saved_seconds == 0
    assert whole.plant_seconds == pytest.approx(6 * 1.0)
    assert cut.saved_seconds > 0
    assert cut.plant_seconds + cut.saved_seconds == pytest.approx(6 * 1.0)
    best = float("inf")
    for ours, theirs in zip(cut.trials, whole.trials, strict=True):
        if ours.outcome == "cut":
            assert 3 * best == ours.give_up < ours.at_least <= theirs.J
        else:
            assert ours.J == theirs.J
            best = min(best, ours.J)


def test_a_cost_of_minus_nothing_does_no_harm(toy_study, tmp_path):
    with Campaign(toy_study, tmp_path / "run") as campaign:
        campaign.ask()
        campaign.tell(1, cost=-0.0)
    with Journal(tmp_path / "run" / "journal.sqlite") as journal:
        assert journal.trials()[0].J == 0.0


def test_a_robot_that_is_flung_beyond_all_measure_is_one_trial_and_not_the_end(toy_study, tmp_path):
    class Flung(type(toy_study.plant)):
        def measured(self):
            return np.full(2, 1e60)

    study = replace(toy_study, plant=Flung(), mpc=replace(toy_study.mpc, output_bounds=None), give_up=None)
    result = replace(study, iterations=2).run(tmp_path / "run", progress=None)
    assert result.complete


def test_what_the_journal_refused_the_search_was_not_told(toy_study, tmp_path, monkeypatch):
    with Campaign(toy_study, tmp_path / "run") as campaign:
        for number in range(1, 8):
            campaign.ask()
            if number < 7:
                campaign.tell(number, cost=float(number))
        with monkeypatch.context() as full:

            def refuse(*_):
                raise JournalError("no space")

            full.setattr(campaign._journal, "add_told", refuse)
            with pytest.raises(JournalError, match="no space"):
                campaign.tell(7, cost=0.5)
        campaign.tell(7, cost=0.5)
        following = campaign.ask()
    with Campaign(toy_study, tmp_path / "again") as campaign:
        for number in range(1, 8):
            campaign.ask()
            campaign.tell(number, cost=float(number) if number < 7 else 0.5)
        assert campaign.ask().theta.tolist() == following.theta.tolist()


def test_a_journal_of_trials_whose_settings_are_gone_is_not_gone_on_with(toy_study, tmp_path):
    with Campaign(toy_study, tmp_path / "run") as campaign:
        campaign.ask()
        campaign.tell(1, cost=1.0)
    (tmp_path / "run" / "study.json").unlink()
    with pytest.raises(RunError, match=r"holds trials, but no study\.json"):
        Campaign(replace(toy_study, seed=5), tmp_path / "run", resume=True)
