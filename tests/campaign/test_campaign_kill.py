"""A campaign that is killed, at any moment, loses no finished trial and goes on as if nothing had happened."""

import multiprocessing
import os
import random
import shutil
from pathlib import Path

import pytest
from conftest import ShortCircle, ToyPlant

from socasadi import LinearMPC, Modal, Study
from socasadi.campaign import Journal

STUDY = Study(plant=ToyPlant(), mpc=LinearMPC(Modal()), task=ShortCircle(), seed_points=12, iterations=5)


def told(trials):
    """All that must not depend on where a campaign was killed: what was asked and what came out, in which order."""
    plain = ("number", "asked", "told", "outcome", "J", "at_least", "give_up", "failure")
    return [(*(getattr(trial, name) for name in plain), trial.theta.tolist()) for trial in trials]


def campaign(folder):
    """In a process of its own: each trial that is told is noted in a file beside the run."""
    log = os.open(f"{folder}.log", os.O_WRONLY | os.O_CREAT | os.O_APPEND)
    STUDY.run(folder, resume=True, progress=lambda progress: os.write(log, b"%d\n" % progress.trial.number))


@pytest.fixture(scope="module")
def start():
    """Starts a campaign in a process that need not import anything first."""
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(["conftest", "socasadi", "GPy"])

    def start(folder):
        process = context.Process(target=campaign, args=(folder,))
        process.start()
        return process

    return start


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    return told(STUDY.run(tmp_path_factory.mktemp("whole") / "run", progress=None).trials)


def check(folder: Path, whole: list) -> int:
    """Number of trials in a folder whose process was killed, after checking them against those of a whole run."""
    if not (journal := folder / "journal.sqlite").exists():
        assert not Path(f"{folder}.log").exists() or not Path(f"{folder}.log").read_text()
        return 0
    alone = folder.parent / "alone"
    shutil.rmtree(alone, ignore_errors=True)
    alone.mkdir()
    shutil.copy(journal, alone)  # without the file of changes that SQLite keeps beside it
    noted = [int(line) for line in Path(f"{folder}.log").read_text().split()]
    with Journal(alone / "journal.sqlite") as copy, Journal(journal) as original:
        assert {trial.number for trial in copy.trials()} >= set(noted)
        trials, pending = original.trials(), original.pending()
    assert told(trials) == whole[: len(trials)]
    assert len(trials) >= len(noted)
    assert [(asked.number, asked.theta.tolist()) for asked in pending] == [
        (row[0], row[-1]) for row in whole[len(trials) : len(trials) + len(pending)]
    ]
    return len(trials)


def kill_at_random(tmp_path, start, whole, times):
    rng, kills, runs, partway = random.Random(5), 0, 0, 0
    folder = tmp_path / "run0"
    while kills < times:
        process = start(folder)
        process.join(rng.uniform(0.0, 1.2))
        if process.exitcode is None:
            process.kill()
            process.join()
            kills += 1
            partway += 0 < check(folder, whole) < len(whole)
        else:
            assert process.exitcode == 0
            assert check(folder, whole) == len(whole)
            runs += 1
            folder = tmp_path / f"run{runs}"
    process = start(folder)
    process.join()
    assert check(folder, whole) == len(whole)
    assert partway > times / 3


def test_sigkill_at_8_random_instants_loses_no_finished_trial_and_changes_no_later_one(tmp_path, start, whole):
    kill_at_random(tmp_path, start, whole, 8)


@pytest.mark.slow
def test_nor_does_it_at_500(tmp_path, start, whole):
    kill_at_random(tmp_path, start, whole, 500)


def test_a_trial_that_was_killed_is_flown_again_with_its_own_theta_and_noise(tmp_path, start, whole):
    class Killed(BaseException):
        pass

    def kill(*_, **__):
        raise Killed

    plant = ToyPlant()
    plant.step = kill
    with pytest.raises(Killed):
        Study(**(vars(STUDY) | {"plant": plant})).run(tmp_path / "run", progress=None)
    with Journal(tmp_path / "run" / "journal.sqlite") as journal:
        (asked,) = journal.pending()
    assert asked.theta.tolist() == whole[0][-1]
    assert told(STUDY.run(tmp_path / "run", resume=True, progress=None).trials) == whole
