import json
import os
import signal
import time
from dataclasses import replace
from math import inf

import numpy as np
import pytest

from socasadi import Circle, LinearMPC, Modal, Study
from socasadi.campaign import Journal, JournalError, Result, RunError, progress_line
from socasadi.plant import ExternalPlantError, PlantFailure


def points(result):
    return np.array([trial.theta for trial in result.trials])


class TestContinuation:
    def test_a_run_that_was_stopped_asks_the_same_points_as_one_that_ran_through(self, toy_study, tmp_path):
        whole = toy_study.run(tmp_path / "whole", progress=None)
        replace(toy_study, iterations=2).run(tmp_path / "parts", progress=None)
        parts = toy_study.run(tmp_path / "parts", resume=True, progress=None)
        np.testing.assert_array_equal(points(parts), points(whole))
        assert [trial.J for trial in parts.trials] == [trial.J for trial in whole.trials]

    def test_an_interrupt_in_the_middle_of_a_trial_loses_no_finished_one(self, toy_study, tmp_path):
        def stop_at_eight(progress):
            if progress.done == 8:
                raise KeyboardInterrupt

        with pytest.raises(KeyboardInterrupt):
            toy_study.run(tmp_path / "run", progress=stop_at_eight)
        with Journal(tmp_path / "run" / "journal.sqlite") as journal:
            assert len(journal.trials()) == 8
        assert len(toy_study.run(tmp_path / "run", resume=True, progress=None).trials) == 12

    def test_more_iterations_may_be_asked_for_later(self, toy_study, tmp_path):
        toy_study.run(tmp_path / "run", progress=None)
        longer = replace(toy_study, iterations=7).run(tmp_path / "run", resume=True, progress=None)
        assert len(longer.trials) == 13


def test_factors_on_settings_are_searched_shown_and_exported_with_the_model(toy_study, tmp_path):
    mpc = replace(toy_study.mpc, tuned={"R": (0.1, 10.0), "input_noise": (0.01, 1.0)})
    study = replace(toy_study, mpc=mpc, task=Circle(duration=1.0, period=2.0))
    result = study.run(tmp_path / "run", progress=None)
    factors = points(result)[:, -2:]
    assert np.ptp(np.log(factors), axis=0).min() > 1.0
    assert Result.open(tmp_path / "run").study.mpc == study.mpc
    record = result.controller_record()
    assert pytest.approx(result.chosen.theta[-2]) == record.mpc.R
    assert record.mpc.tuned == ()
    assert any("R_factor" in line for line in record.provenance)


class TestFailures:
    class Fragile:
        """Breaks whenever a tension exceeds a limit, as a robot with a weak cable would."""

        sample_time, inputs, outputs = 0.05, 3, 2

        def __init__(self, weakest=9.9):
            self.weakest = weakest
            self.tension = np.zeros(3)

        def reset(self, tip=None, *, seed=None, tension_bounds=(-inf, inf)):
            self.y = np.zeros(2)
            return self.y

        def step(self, tension, tip_force=None):
            if np.abs(tension).max() > self.weakest:
                raise PlantFailure("a cable broke")
            self.y = self.y + 0.2 * (0.005 * np.array([tension[0], tension[1] - tension[2]]) - self.y)
            return self.y

    @pytest.fixture
    def fragile(self):
        return Study(
            plant=self.Fragile(),
            mpc=LinearMPC(Modal()),
            task=Circle(duration=1.0, period=2.0),
            seed_points=8,
            iterations=4,
        )

    def test_a_failed_trial_is_kept_with_its_reason_and_its_record_until_then(self, fragile, tmp_path):
        result = fragile.run(tmp_path / "run", progress=None)
        failed = [trial for trial in result.trials if trial.failure]
        assert failed
        assert all(trial.failure == "PlantFailure: a cable broke" and trial.J is None for trial in failed)
        cut = result.episode(failed[0].number)
        assert len(cut.output) == len(cut.tension) + 1 < 21
        assert result.best.failure is None

    def test_when_nothing_succeeds_the_reasons_are_said(self, fragile, tmp_path):
        result = replace(fragile, plant=self.Fragile(0.0), iterations=1).run(tmp_path / "run", progress=None)
        assert len(result.trials) == 9
        with pytest.raises(RunError, match=r"none of the 9 trials .* succeeded: PlantFailure: a cable broke"):
            _ = result.best

    def test_an_episode_beyond_its_time_limit_has_failed(self, toy_study, tmp_path):
        class Slow(type(toy_study.plant)):
            def step(self, tension, tip_force=None):
                time.sleep(0.02)
                return super().step(tension, tip_force)

        study = replace(toy_study, plant=Slow(), seed_points=1, iterations=0, time_limit=0.1)
        (trial,) = study.run(tmp_path / "run", progress=None).trials
        assert trial.failure == "TimeoutError: took longer than its limit of 0.1 s"

    def test_outputs_that_are_not_finite_are_a_failure_and_not_a_cost(self, toy_study, tmp_path):
        class Blind(type(toy_study.plant)):
            def measured(self):
                return np.full(2, np.nan)

        study = replace(toy_study, plant=Blind(), seed_points=1, iterations=0)
        (trial,) = study.run(tmp_path / "run", progress=None).trials
        assert trial.J is None
        assert "y must be finite" in trial.failure


class TestRunFolder:
    def test_one_that_exists_is_not_touched_without_resume(self, toy_study, tmp_path):
        (tmp_path / "notes.txt").write_text("mine")
        with pytest.raises(RunError, match="exists already; resume it"):
            toy_study.run(tmp_path, progress=None)
        assert [file.name for file in tmp_path.iterdir()] == ["notes.txt"]

    def test_another_studys_run_is_refused_and_the_difference_named(self, toy_study, tmp_path):
        replace(toy_study, iterations=0).run(tmp_path / "run", progress=None)
        other = replace(toy_study, mpc=replace(toy_study.mpc, R=2.0), seed=3)
        with pytest.raises(RunError, match=r"other settings: mpc\.R was 1\.0 and is 2\.0; seed was 0 and is 3"):
            other.run(tmp_path / "run", resume=True, progress=None)

    def test_settings_are_stored_whole_and_make_the_study_again(self, toy_study, tmp_path):
        from socasadi import Rod, SimulatedPlant

        study = replace(toy_study, plant=SimulatedPlant(Rod.preset("paper")), task=Circle(), seed=7)
        stored = json.loads(json.dumps(study.settings))
        again = Study.from_settings(stored)
        assert again.settings == study.settings
        assert again.mpc == study.mpc
        assert again.plant.rod == study.plant.rod

    def test_a_robot_of_the_users_own_need_not_be_there_to_read_its_run(self, toy_study, tmp_path):
        run = replace(toy_study, task=Circle(duration=1.0), iterations=0).run(tmp_path / "run", progress=None)
        opened = Result.open(tmp_path / "run")
        assert opened.best.J == run.best.J
        with pytest.raises(ExternalPlantError, match=r"conftest\.ToyPlant cannot be flown from here"):
            opened.study.plant.reset()

    def test_a_task_of_the_users_own_must_be(self, toy_study, tmp_path):
        replace(toy_study, iterations=0).run(tmp_path / "run", progress=None)
        with pytest.raises(RunError, match=r"conftest\.ShortCircle can only be made by the study script"):
            Result.open(tmp_path / "run")

    @pytest.mark.parametrize("content", ["", "{}", "{nonsense"])
    def test_damaged_settings_are_said(self, tmp_path, content):
        (tmp_path / "study.json").write_text(content)
        with pytest.raises(RunError, match=r"study\.json is damaged"):
            Result.open(tmp_path)


class TestStudy:
    @pytest.mark.parametrize(
        ("changes", "words"),
        [
            ({"mpc": LinearMPC(Modal(), sample_time=0.1)}, "sample_time of the plant is 0.05, but 0.1 of the MPC"),
            ({"mpc": LinearMPC(Modal(inputs=4))}, "inputs of the plant is 3, but 4"),
            ({"seed_points": 0}, "seed_points is an integer of at least 1, not 0"),
            ({"iterations": -1}, "iterations is an integer of at least 0, not -1"),
            ({"search": "annealing"}, "unknown search 'annealing'; there are bayesian, paper, sobol"),
            ({"time_limit": 0}, "time_limit must be positive"),
        ],
    )
    def test_parts_that_do_not_fit_are_named(self, toy_study, changes, words):
        with pytest.raises(ValueError, match=words):
            replace(toy_study, **changes)

    def test_the_sobol_baseline_starts_with_the_same_points_and_noise(self, toy_study, tmp_path):
        search = toy_study.run(tmp_path / "search", progress=None)
        sobol = toy_study.sobol_only().run(tmp_path / "sobol", progress=None)
        seeds = toy_study.seed_points
        assert [t.J for t in sobol.trials[:seeds]] == [t.J for t in search.trials[:seeds]]
        assert len(sobol.trials) == len(search.trials)


@pytest.mark.parametrize("search", ["paper", "sobol"])
def test_every_search_by_name_makes_a_whole_run(toy_study, tmp_path, search):
    study = replace(toy_study, search=search, iterations=3)
    assert len(study.run(tmp_path / "run", progress=None).trials) == 9


def test_a_pulse_on_the_tip_is_felt(toy_study, tmp_path):
    from socasadi import Origin, Pulse

    def farthest(pulse):
        study = replace(toy_study, task=Origin(duration=1.0, pulse=pulse), seed_points=1, iterations=0)
        episode = study.run(tmp_path / str(pulse is None), progress=None).episode(1)
        return np.abs(episode.truth[11:14, 0]).max()

    assert farthest(Pulse(time=0.5, duration=0.1, force=(0, 50, 0))) > farthest(None) + 0.01


class TestPlantsOfOnesOwn:
    def test_one_that_uses_its_buffer_again_gives_the_same_run(self, toy_study, tmp_path):
        class Driver(type(toy_study.plant)):
            def measured(self):
                self.buffer = getattr(self, "buffer", np.zeros(2))
                self.buffer[:] = super().measured()
                return self.buffer

        study = replace(toy_study, iterations=0)
        plain = study.run(tmp_path / "plain", progress=None)
        driven = replace(study, plant=Driver()).run(tmp_path / "driven", progress=None)
        assert [trial.J for trial in driven.trials] == [trial.J for trial in plain.trials]

    @pytest.mark.parametrize("wrong", [np.zeros(3), np.zeros((2, 1)), None, "blind"])
    def test_an_output_that_is_none_is_a_failure_that_says_so(self, toy_study, tmp_path, wrong):
        class Odd(type(toy_study.plant)):
            def step(self, tension, tip_force=None):
                return wrong

        study = replace(toy_study, plant=Odd(), seed_points=1, iterations=0)
        (trial,) = study.run(tmp_path / "run", progress=None).trials
        assert trial.failure.startswith("ValueError: the plant returned")

    def test_what_prepare_raises_ends_the_run_before_any_trial(self, toy_study, tmp_path):
        class Unbuilt(type(toy_study.plant)):
            def prepare(self):
                raise OSError("the serial port is taken")

        with pytest.raises(OSError, match="serial port"):
            replace(toy_study, plant=Unbuilt()).run(tmp_path / "run", progress=None)
        assert len(toy_study.run(tmp_path / "again", progress=None).trials) == 12
        with Journal(tmp_path / "run" / "journal.sqlite") as journal:
            assert journal.trials() == []

    def test_what_lacks_a_part_is_no_plant_and_the_part_is_named(self, toy_study):
        class Half:
            sample_time, inputs, outputs = 0.05, 3, 2

        with pytest.raises(TypeError, match="it lacks reset, step, tension"):
            replace(toy_study, plant=Half())


class TestWriters:
    def test_a_second_writer_is_told_who_holds_it(self, toy_study, tmp_path):
        replace(toy_study, iterations=0).run(tmp_path / "run", progress=None)
        with (
            Journal(tmp_path / "run" / "journal.sqlite", writer=True),
            pytest.raises(JournalError, match=f"is being written by process {os.getpid()}"),
        ):
            toy_study.run(tmp_path / "run", resume=True, progress=None)

    def test_a_refused_writer_changes_nothing(self, toy_study, tmp_path):
        replace(toy_study, iterations=0).run(tmp_path / "run", progress=None)
        before = (tmp_path / "run" / "study.json").read_bytes()
        with Journal(tmp_path / "run" / "journal.sqlite", writer=True), pytest.raises(JournalError):
            toy_study.run(tmp_path / "run", resume=True, progress=None)
        assert (tmp_path / "run" / "study.json").read_bytes() == before

    def test_fewer_trials_than_there_are_cannot_be_asked_for(self, toy_study, tmp_path):
        replace(toy_study, iterations=1).run(tmp_path / "run", progress=None)
        with pytest.raises(RunError, match="holds 7 trials already; ask for no fewer, not for 6"):
            replace(toy_study, iterations=0).run(tmp_path / "run", resume=True, progress=None)


@pytest.mark.parametrize("then", [lambda: None, lambda: float("no number")])
def test_ctrl_c_that_a_library_drops_still_ends_the_run_and_loses_no_trial(toy_study, tmp_path, then):
    """CasADi's conversion of arguments drops a KeyboardInterrupt, or fails in its own way."""
    plant, steps = toy_study.plant, iter(range(10_000))
    step = plant.step

    def dropping(tension, tip_force=None):
        if next(steps) == 50:  # in the third trial of 20 samples
            try:
                os.kill(os.getpid(), signal.SIGINT)
                time.sleep(0.1)
            except KeyboardInterrupt:
                then()
        return step(tension, tip_force)

    plant.step = dropping
    with pytest.raises(KeyboardInterrupt):
        toy_study.run(tmp_path / "run")
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    del plant.step
    result = toy_study.run(tmp_path / "run", resume=True)
    assert [trial.number for trial in result.trials] == list(range(1, 13))
    assert all(trial.outcome != "failed" for trial in result.trials)


def test_each_trial_is_reported_with_its_outcome_the_best_and_the_time_left(toy_study, tmp_path):
    told = []
    replace(toy_study, give_up=3.0, iterations=0).run(tmp_path / "run", progress=told.append)
    lines = [progress_line(progress) for progress in told]
    assert [progress.done for progress in told] == [1, 2, 3, 4, 5, 6]
    cut = next(progress for progress in told if progress.trial.outcome == "cut")
    line = lines[cut.done - 1]
    assert line.startswith(f"trial {cut.trial.number}/6  ")
    assert f"cut, J > {cut.trial.at_least:.4g}" in line
    assert f"(trial {cut.best.number})" in line
    assert all(" elapsed, " in line and line.endswith(" left") for line in lines)
    assert min(trial.J for trial in (progress.trial for progress in told[: cut.done]) if trial.J) == cut.best.J
