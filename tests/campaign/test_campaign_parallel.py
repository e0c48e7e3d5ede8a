"""Trials side by side: the same trials, whoever flies them and whatever becomes of those who do."""

import concurrent.futures
import multiprocessing
import os
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import pytest

from socasadi.campaign import Campaign, Journal, Processes, RunError, load_study
from socasadi.campaign.execution import _loop

ROOT = os.path.dirname(os.path.dirname(__file__))
# A robot that does odd things in some trials, which it knows by their noise.
SCRIPT = """
import os, signal, sys, time
from pathlib import Path
sys.path.insert(0, {root!r})
import numpy as np
from conftest import ShortCircle, ToyPlant
from socasadi import LinearMPC, Modal, Study
from socasadi.plant import SimulatedPlant

FOLDER = Path({folder!r})
SEEDS = [int(np.random.SeedSequence([0, 0, number]).generate_state(1)[0]) for number in range(100)]

class Odd(ToyPlant):
    def reset(self, tip=None, *, seed=None, **settings):
        self.trial = SEEDS.index(seed) if seed in SEEDS else None
        return super().reset(tip, seed=seed)

    def step(self, tension, tip_force=None):
        {odd}
        return super().step(tension, tip_force)

    def once(self):
        try:
            (FOLDER / f"done{{self.trial}}").touch(exist_ok=False)
        except FileExistsError:
            return False
        return True

study = Study(plant=Odd(), mpc=LinearMPC(Modal()), task=ShortCircle(), {settings})
"""


@pytest.fixture
def script(tmp_path):
    def write(odd="pass", settings="search='sobol', seed_points=8, iterations=0, give_up=None"):
        file = tmp_path / "study.py"
        file.write_text(SCRIPT.format(root=ROOT, folder=str(tmp_path), odd=odd, settings=settings))
        return file

    return write


def processes_of(folder):
    """Ids of living processes that were started for a study in ``folder``."""
    found = []
    for entry in Path("/proc").iterdir():
        try:
            if entry.name.isdigit() and str(folder).encode() in (entry / "cmdline").read_bytes():
                found.append(int(entry.name))
        except OSError:
            continue
    return [process for process in found if process != os.getpid()]


def outcomes(result):
    return {trial.number: (trial.theta.tolist(), trial.J) for trial in result.trials}


@pytest.fixture
def alone(script, tmp_path):
    """What a serial run of the study gives, without anything odd."""
    return load_study(script()).run(tmp_path / "alone", progress=None)


class TestExecutors:
    @pytest.mark.parametrize("kind", ["own processes", "threads"])
    def test_every_executor_gives_the_trials_of_a_serial_run(self, script, alone, tmp_path, kind):
        file = script()
        study, folder = load_study(file), tmp_path / "run"
        if kind == "own processes":
            result = study.run(folder, jobs=2, script=file, progress=None)
        else:
            with concurrent.futures.ThreadPoolExecutor(2) as executor:
                result = study.run(folder, jobs=2, executor=executor, script=file, progress=None)
        assert outcomes(result) == outcomes(alone)
        assert result.episode(3).output.tolist() == alone.episode(3).output.tolist()

    def test_settings_alone_make_the_study_in_a_worker_when_they_can(self, tmp_path):
        from socasadi import Circle, LinearMPC, Modal, Rod, SimulatedPlant, Study

        plant, mpc = SimulatedPlant(Rod.preset("paper")), LinearMPC(Modal())
        study = Study(plant=plant, mpc=mpc, task=Circle(duration=0.5), seed_points=3, iterations=0, give_up=None)
        side_by_side = study.run(tmp_path / "two", jobs=2, progress=None)
        assert outcomes(side_by_side) == outcomes(study.run(tmp_path / "one", progress=None))

    @pytest.mark.parametrize(
        ("text", "words"),
        [
            (None, r"makes another study there: mpc\.R was 2\.0 and is 1\.0"),
            ("", "defines no `study`"),
            ("import os\nos._exit(3)\n", r"no worker answers: BrokenExecutor: process \d+ ended \(exit code 3\)"),
        ],
    )
    def test_a_study_that_no_worker_can_make_is_refused_before_any_trial(self, script, tmp_path, text, words):
        file = script()
        study = load_study(file)
        study = replace(study, mpc=replace(study.mpc, R=2.0))
        if text is not None:
            file.write_text(text)
        with Processes(1) as one, pytest.raises(RunError, match=words):
            study.run(tmp_path / "run", executor=one, script=file)
        with Journal(tmp_path / "run" / "journal.sqlite") as journal:
            assert not journal.trials()
            assert not journal.pending()

    def test_a_script_that_runs_its_study_when_it_is_loaded_is_told_how_not_to(self, script, tmp_path):
        file = script()
        study = load_study(file)
        file.write_text(file.read_text() + f"study.run({str(tmp_path / 'inner')!r}, jobs=2)\n")
        with Processes(1) as one, pytest.raises(RunError, match="put that under `if __name__ == '__main__':`"):
            study.run(tmp_path / "run", executor=one, script=file)
        assert not (tmp_path / "inner").exists()

    def test_an_error_of_the_program_is_no_outcome_of_a_trial(self, script, tmp_path):
        """It stops the run, as it does in a serial one."""
        file = script()
        wrong = "class Wrong(Modal):\n    def state_space(self, *_): raise KeyError('no such mode')\n\n"
        text = file.read_text().replace("LinearMPC(Modal())", "LinearMPC(Wrong())")
        file.write_text(text.replace("class Odd", f"{wrong}class Odd"))
        study = load_study(file)
        with pytest.raises(KeyError, match="no such mode"):
            study.run(tmp_path / "serial")
        with (
            concurrent.futures.ThreadPoolExecutor(2) as executor,
            pytest.raises(RunError, match="another process cannot fly this study: KeyError: 'no such mode'"),
        ):
            study.run(tmp_path / "run", jobs=2, executor=executor, script=file)

    def test_options_that_change_a_number_of_the_script_reach_the_workers(self, script, tmp_path):
        file = script()
        study = replace(load_study(file), seed=3, seed_points=3)
        with concurrent.futures.ThreadPoolExecutor(2) as executor:
            result = study.run(tmp_path / "two", jobs=2, executor=executor, script=file, progress=None)
        assert outcomes(result) == outcomes(study.run(tmp_path / "one", progress=None))

    def test_so_do_start_points(self, script, tmp_path):
        file = script(settings="seed_points=3, iterations=0, give_up=None")
        study = load_study(file)
        middle = [0.5 * (entry.lower + entry.upper) + 1e-3 for entry in study.mpc.model.entries]
        with concurrent.futures.ThreadPoolExecutor(2) as executor:
            started = replace(study, initial=[middle])
            result = started.run(tmp_path / "two", jobs=2, executor=executor, script=file, progress=None)
        first = next(trial for trial in result.trials if trial.number == 1)
        assert first.theta.tolist() == middle

    @pytest.mark.parametrize("jobs", [0, -1, 1.5, "two"])
    def test_a_number_of_jobs_is_one(self, toy_study, tmp_path, jobs):
        with pytest.raises(ValueError, match="jobs is the number of trials at once, at least 1, not"):
            toy_study.run(tmp_path / "run", jobs=jobs)

    def test_an_executor_that_does_not_say_how_many_needs_to_be_told(self, toy_study, tmp_path):
        with (
            concurrent.futures.ThreadPoolExecutor(2) as executor,
            pytest.raises(ValueError, match="jobs is the number of trials at once"),
        ):
            toy_study.run(tmp_path / "run", executor=executor)


def test_the_journals_order_of_asks_and_tells_gives_every_point_again(script, tmp_path):
    file = script("time.sleep(0.01 * (self.trial * 7 % 5))", "seed_points=6, iterations=8")
    study = load_study(file)
    with concurrent.futures.ThreadPoolExecutor(3) as executor:
        result = study.run(tmp_path / "run", jobs=3, executor=executor, script=file, progress=None)
    trials = result.trials
    assert [trial.number for trial in trials] != list(range(1, 15))
    happened = {trial.asked: trial for trial in trials} | {trial.told: trial for trial in trials}
    search, out = study.optimizer(), {}
    for event in range(1, 29):
        trial = happened[event]
        if event == trial.asked:
            assert search.ask(pending=list(out.values())).tolist() == trial.theta.tolist()
            out[trial.number] = trial.theta
        else:
            del out[trial.number]
            if trial.outcome == "done":
                search.tell(trial.theta, trial.J)
            else:
                search.tell(trial.theta, at_least=trial.at_least)


def test_a_slow_trial_holds_up_nobody(script, tmp_path):
    """Trial 1 waits until all others are told; it could wait for ever if they waited for it."""
    file = script("while self.trial == 1 and not (FOLDER / 'go').exists(): time.sleep(0.01)")
    study = load_study(file)

    def go(progress):
        if progress.done == 7:
            (tmp_path / "go").touch()

    with concurrent.futures.ThreadPoolExecutor(2) as executor:
        result = study.run(tmp_path / "run", jobs=2, executor=executor, script=file, progress=go)
    assert [trial.number for trial in result.trials] == [2, 3, 4, 5, 6, 7, 8, 1]


class TestLostWorkers:
    KILL = "os.kill(os.getpid(), signal.SIGKILL)"

    def test_a_trial_whose_worker_died_is_flown_again_and_one_that_kills_them_all_has_failed(
        self, script, alone, tmp_path
    ):
        file = script(f"if self.trial == 4 or self.trial == 2 and self.once(): {self.KILL}\n        time.sleep(0.002)")
        result = load_study(file).run(tmp_path / "run", jobs=2, script=file, progress=None)
        assert (tmp_path / "done2").exists()
        (failed,) = [trial for trial in result.trials if trial.outcome == "failed"]
        assert failed.number == 4
        assert failed.failure.startswith("its worker was lost 3 times, at last by BrokenExecutor: process")
        assert "signal 9" in failed.failure
        assert outcomes(result) == outcomes(alone) | {4: (failed.theta.tolist(), None)}

    def test_an_executor_that_breaks_ends_the_run_in_a_sentence_and_resuming_finishes_it(self, script, tmp_path):
        file = script(f"if self.trial == 4 and self.once(): {self.KILL}")
        study, context = load_study(file), multiprocessing.get_context("spawn")
        with (
            concurrent.futures.ProcessPoolExecutor(2, mp_context=context) as executor,
            pytest.raises(RunError, match=r"takes no more trials \(BrokenProcessPool: .*what was told is stored"),
        ):
            study.run(tmp_path / "run", jobs=2, executor=executor, script=file, progress=None)
        again = study.run(tmp_path / "run", resume=True, jobs=2, script=file, progress=None)
        assert sorted(trial.number for trial in again.trials) == list(range(1, 9))


class TestTimeouts:
    def test_a_step_that_blocks_is_broken_off_in_a_serial_run(self, script, tmp_path):
        file = script(
            "if self.trial == 3: time.sleep(1000)", "search='sobol', seed_points=4, iterations=0, time_limit=0.3"
        )
        result = load_study(file).run(tmp_path / "run", progress=None)
        failed = [trial for trial in result.trials if trial.outcome == "failed"]
        assert [trial.number for trial in failed] == [3]
        assert failed[0].failure == "TimeoutError: took longer than its limit of 0.3 s, and was broken off"
        assert len(result.episode(3).output) == 1
        assert signal.getsignal(signal.SIGALRM) is signal.SIG_DFL

    @pytest.mark.slow
    def test_a_worker_that_hears_nothing_is_ended_and_another_takes_its_place(self, script, tmp_path, monkeypatch):
        deaf = "signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGALRM]); time.sleep(1000)"
        settings = "search='sobol', seed_points=6, iterations=0, time_limit=2.0"
        file = script(f"if self.trial == 2:\n            {deaf}", settings)
        monkeypatch.setattr(_loop, "GRACE", 8.0)
        with Processes(1) as one:
            result = load_study(file).run(tmp_path / "run", executor=one, script=file, progress=None)
        failed = {trial.number: trial.failure for trial in result.trials if trial.outcome == "failed"}
        assert failed == {2: "TimeoutError: no answer 8 s after its limit of 2 s"}
        assert len(result.trials) == 6
        assert not processes_of(tmp_path)

    def test_executors_that_cannot_end_a_worker_are_used_without_it(self, script, tmp_path, monkeypatch):
        wait = "while not (FOLDER / 'go').exists(): time.sleep(0.01)"
        settings = "search='sobol', seed_points=6, iterations=0, time_limit=0.5"
        file = script(f"if self.trial == 1:\n            {wait}", settings)
        monkeypatch.setattr(_loop, "GRACE", 1.0)
        study = load_study(file)
        with concurrent.futures.ThreadPoolExecutor(2) as executor:
            result = study.run(tmp_path / "run", jobs=2, executor=executor, script=file, progress=None)
            (tmp_path / "go").touch()
        assert [trial.number for trial in result.trials if trial.outcome == "failed"] == [1]
        assert len(result.trials) == 6

    def test_a_trial_that_waits_in_a_queue_has_not_failed(self, script, tmp_path, monkeypatch):
        settings = "search='sobol', seed_points=4, iterations=0, time_limit=5.0"
        file = script("if self.trial == 1 and self.once():\n            time.sleep(1.5)", settings)
        monkeypatch.setattr(_loop, "GRACE", -4.0)
        study = load_study(file)
        with concurrent.futures.ThreadPoolExecutor(1) as executor:
            result = study.run(tmp_path / "run", jobs=4, executor=executor, script=file, progress=None)
        assert [trial.number for trial in result.trials if trial.outcome == "failed"] == [1]


class TestStops:
    def start(self, file, tmp_path):
        code = (
            "from pathlib import Path; from socasadi.campaign import load_study; "
            f"file = Path({str(file)!r}); "
            f"load_study(file).run({str(tmp_path / 'run')!r}, resume=True, jobs=2, script=file)"
        )
        process = subprocess.Popen(
            [sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )
        while not process.stdout.readline().startswith("trial"):
            assert process.poll() is None, process.stderr.read()
        return process

    @pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGKILL])
    def test_no_worker_is_left_behind_and_nothing_told_is_lost(self, script, tmp_path, number):
        settings = "search='sobol', seed_points=24, iterations=0"
        wait = "while self.trial > 6 and not (FOLDER / 'go').exists(): time.sleep(0.01)"
        file = script(wait, settings)
        process = self.start(file, tmp_path)
        assert len(processes_of(tmp_path)) >= 3
        process.send_signal(number)
        said, complained = process.communicate(timeout=30)
        assert process.returncode != 0
        assert ("KeyboardInterrupt" in complained) == (number == signal.SIGINT)
        patience = time.monotonic() + 20
        while processes_of(tmp_path) and time.monotonic() < patience:
            time.sleep(0.05)
        assert not processes_of(tmp_path)
        with Journal(tmp_path / "run" / "journal.sqlite") as journal:
            told, out = journal.trials(), journal.pending()
        assert len(told) >= 1 + said.count("trial ") // 2
        assert 1 <= len(out) <= 2
        (tmp_path / "go").touch()
        study = load_study(file)
        result = study.run(tmp_path / "run", resume=True, jobs=2, script=file, progress=None)
        assert [trial.number for trial in result.trials[: len(told)]] == [trial.number for trial in told]
        assert sorted(trial.number for trial in result.trials) == list(range(1, 25))
        for asked in out:
            (flown,) = [trial for trial in result.trials if trial.number == asked.number]
            assert flown.theta.tolist() == asked.theta.tolist()
            assert flown.asked == asked.asked


def test_processes_are_an_executor():
    with Processes(2) as executor:
        assert list(executor.map(os.path.basename, ["/a/b", "/c/d"])) == ["b", "d"]
        with pytest.raises(RuntimeError, match="TypeError"):
            executor.submit(os.path.basename, None).result()
        assert executor.submit(os.getpid).result() != os.getpid()
    with pytest.raises(concurrent.futures.BrokenExecutor):
        executor.submit(os.getpid)


def test_what_is_asked_by_hand_no_run_flies(script, tmp_path):
    file = script()
    study = load_study(file)
    with Campaign(study, tmp_path / "run") as campaign:
        mine = campaign.ask()
    result = study.run(tmp_path / "run", resume=True, progress=None)
    assert [trial.number for trial in result.trials] == list(range(2, 9))
    assert [asked.number for asked in result.pending] == [mine.number]
    assert not result.complete
