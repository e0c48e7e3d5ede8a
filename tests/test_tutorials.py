"""The tutorials run from top to bottom, and print and leave behind what they say."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from socasadi.campaign import Result
from socasadi.codegen import c_compiler
from socasadi.export import toolchain

STUDIES = Path(__file__).parents[1] / "studies"
with_compiler = pytest.mark.skipif(c_compiler() is None or not shutil.which("make"), reason="no C compiler")


def read(name: str, folder: Path, *arguments: str, env: dict | None = None) -> subprocess.CompletedProcess[str]:
    """One tutorial, as a reader runs it in ``folder``."""
    command = [sys.executable, str(STUDIES / f"tutorial_{name}.py"), *arguments]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=300, env=env)


def said(words: str, command: str) -> str:
    """What a command of a tutorial has printed."""
    assert f"\n$ {command}\n" in f"\n{words}", f"no {command!r} in:\n{words}"
    return f"\n{words}".split(f"\n$ {command}\n")[1].split("\n$ ")[0]


def test_the_first_tunes_a_simulated_arm(tmp_path):
    done = read("1_simulated_arm", tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    script, run = STUDIES / "tutorial_1_simulated_arm.py", "runs/tutorial-1/circle"
    told = said(done.stdout, f"socasadi check {script} --figures runs/tutorial-1/check")
    assert "nothing stands against it" in told
    assert "a circle of 15 cm radius:\n  infeasible: reach: " in told
    assert re.search(r"after 5 s at \(0\.03\d\d|after 5 s at \(0\.029\d", done.stdout)
    assert done.stdout.splitlines()[-1].endswith("STABLE")
    result = Result.open(tmp_path / run)
    assert result.complete
    seeds = [trial.J for trial in result.trials if trial.phase == "seed" and trial.J is not None]
    assert result.best.phase == "search"
    assert result.best.J is not None
    assert min(seeds) > result.best.J
    told = said(done.stdout, f"socasadi run {script} --out {run} --resume")
    assert f"J = {result.best.J:.4g} (trial {result.best.number})" in told
    assert "Sobol" in said(done.stdout, f"socasadi show {run}")
    assert said(done.stdout, f"socasadi report {run}").startswith(f"{run}/report.html: ")
    assert (tmp_path / run / "report.html").stat().st_size > 1e6
    assert (tmp_path / "runs/tutorial-1/check/reach.png").exists()


@pytest.mark.slow
def test_the_first_flies_nothing_again(tmp_path):
    told = []
    for _ in range(2):
        done = read("1_simulated_arm", tmp_path, "arm")
        assert done.returncode == 0, done.stdout + done.stderr
        told.append([trial.told for trial in Result.open(tmp_path / "arm" / "circle").trials])
    assert told[0] == told[1]


def test_the_second_brings_a_campaign_to_its_end_and_refuses_to_begin_over_it(tmp_path):
    done = read("2_own_robot", tmp_path, "lab")
    assert done.returncode == 0, done.stdout + done.stderr
    assert "known from the data sheet:" in said(done.stdout, "socasadi check arm.py --spec arm.toml")
    told = said(done.stdout, "socasadi check arm.py --spec arm.toml --record probe.csv")
    assert "known from the data sheet and the probing record:" in told
    pending = said(done.stdout, "socasadi ask runs/arm --pending").splitlines()
    assert [line.split()[0] for line in pending] == ["trial", "2", "3"]
    told = said(done.stdout, "socasadi tell runs/arm --trial 2 --csv millimetres.csv")
    assert told.startswith("socasadi: millimetres.csv, line ")
    assert "is it in m?" in told
    told = said(done.stdout, "socasadi tell runs/arm --trial 4 --csv recording-2.csv")
    assert "holds the inputs of trial 2's controller" in told
    assert "taken back" in said(done.stdout, "socasadi tell runs/arm --trial 4 --take-back")
    assert "trial 8" in said(done.stdout, "socasadi tell runs/arm --trial 8 --csv recording-8.csv")

    told = said(done.stdout, "socasadi show runs/arm")
    assert "too few trials to say what the best is worth without noise" in told
    assert "as estimated" not in told

    result = Result.open(tmp_path / "lab" / "runs" / "arm")
    assert result.complete
    trials = {trial.number: trial for trial in result.trials}
    assert trials[3].failure == "cable 2 slipped off its pulley"
    # The J that the tutorial computes from its own recording is the package's.
    (slip,) = result.taken_back
    assert pytest.approx(10 * slip.J, rel=1e-4) == trials[4].J
    assert any(trial.outcome == "cut" for trial in result.trials)
    assert min(trial.J for trial in result.trials if trial.phase == "seed" and trial.J is not None) == trials[1].J
    assert len((tmp_path / "lab" / "trials.csv").read_text().splitlines()) == 9
    assert (tmp_path / "lab" / "build" / "controller.h").exists()

    again = read("2_own_robot", tmp_path, "lab")
    assert again.returncode == 1
    assert again.stderr == "lab is there already: remove it to begin again, or name another folder\n"
    assert not again.stdout


@pytest.fixture
def no_emulator(tmp_path):
    """An environment in which everything is found but the cross compiler and the emulator."""
    folder = tmp_path / "bin"
    folder.mkdir()
    for place in os.environ["PATH"].split(os.pathsep):
        for file in Path(place).glob("*"):
            if not file.name.startswith(("arm-none-eabi", "qemu")) and not (folder / file.name).is_symlink():
                (folder / file.name).symlink_to(file)
    return os.environ | {"PATH": str(folder)}


def follows_the_circle(done: subprocess.CompletedProcess[str], folder: Path) -> None:
    assert done.returncode == 0, done.stdout + done.stderr
    assert said(done.stdout, "make -s -C mcu/double test").startswith("passed: 200 samples of the episode")
    assert "passed: " in said(done.stdout, "socasadi export mcu/run --out mcu/float --real float")
    assert "controller_data.h" in said(done.stdout, "ls mcu/double").split()
    flown = said(done.stdout, str((folder / "mcu" / "firmware").resolve()))
    assert float(re.findall(r"RMSE after 5 s (\S+) mm", flown)[0]) < 5
    assert "200 steps" in flown
    assert "0 clipped, 0 held, 3 measurements refused" in flown
    assert "warning" not in done.stdout


@with_compiler
def test_the_third_leaves_tested_c_and_a_loop_that_follows_the_circle(tmp_path):
    done = read("3_microcontroller", tmp_path, "mcu")
    follows_the_circle(done, tmp_path)
    if toolchain() is None:
        assert "instructions a step, of the episode" in said(done.stdout, "socasadi emulate mcu/run")
    else:
        assert "skipped, socasadi emulate: " in done.stdout


@with_compiler
@pytest.mark.slow
def test_the_third_goes_on_without_the_emulator(tmp_path, no_emulator):
    done = read("3_microcontroller", tmp_path, "mcu", env=no_emulator)
    follows_the_circle(done, tmp_path)
    assert "skipped, socasadi emulate: " in done.stdout
