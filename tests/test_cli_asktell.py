"""A campaign from the shell, on a robot that Python never touches."""

import csv
import json
import re
import shlex
import shutil
import sqlite3
import subprocess
import sys
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from conftest import ToyPlant

from socasadi import Campaign, cli
from socasadi.campaign import Bench, Result, fly, load_study, write_recording
from socasadi.codegen import c_compiler
from socasadi.mpc import DesignError

with_compiler = pytest.mark.skipif(c_compiler() is None, reason="no C compiler")

STUDY = """
from socasadi import *
arm = ExternalPlant(sample_time=0.05, inputs=3, outputs=2, name="the arm in room 12")
task = Circle(duration=1.0, period=2.0)
study = Study(plant=arm, mpc=LinearMPC(Modal()), task=task, seed_points=3, iterations=3{more})
"""
ROBOT = """
#include "experiment.h"

static double state[2];

int robot_start(real y[CONTROLLER_OUTPUTS], real u[CONTROLLER_INPUTS]) {
    int i;
    for (i = 0; i < 2; ++i) y[i] = (real)(state[i] = 0);
    for (i = 0; i < 3; ++i) u[i] = 0;
    return 0;
}

int robot_hold(const real u[CONTROLLER_INPUTS], real y[CONTROLLER_OUTPUTS]) {
    state[0] += 0.2 * (0.005 * (1.0 * u[0] - 0.5 * u[1] - 0.5 * u[2]) - state[0]);
    state[1] += 0.2 * (0.005 * (0.87 * u[1] - 0.87 * u[2]) - state[1]);
    y[0] = (real)state[0];
    y[1] = (real)state[1];
    return 0;
}
"""


@pytest.fixture
def at_the_bench(tmp_path, monkeypatch):
    """A folder with study.py, as the working directory."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(warnings, "showwarning", warnings.showwarning)
    write_study()
    return tmp_path


@pytest.fixture
def socasadi(capsys, monkeypatch):
    """The command, each time from nothing but the folder; returns what it printed, or why it was refused."""

    def call(*arguments, refused=False):
        monkeypatch.setattr(sys, "argv", ["socasadi", *map(str, arguments)])
        with pytest.raises(SystemExit) as ended:
            cli.main()
        said = capsys.readouterr()
        if refused:
            assert ended.value.code == 1
            assert said.err.startswith("socasadi: ")
            assert len(said.err.strip().splitlines()) == 1, said.err
            assert not said.out
            return said.err
        assert not ended.value.code, said.err
        return said.out

    return call


def write_study(more="", name="study.py"):
    Path(name).write_text(STUDY.format(more=more))
    return name


def asked(socasadi, *options):
    return json.loads(socasadi("ask", "runs/study", "--json", *options))


def flight(trial, noise=1e-3, study="study.py"):
    """What the robot does with a trial's theta."""
    study = load_study(Path(study))
    controller = study.mpc.controller(list(trial["theta"].values()))
    return fly(ToyPlant(noise), controller, study.task, seed=trial["trial"], time_limit=60)


def recording(trial, path=None):
    """The same as a file."""
    write_recording(flight(trial), path := path or f"recording-{trial['trial']}.csv")
    return path


def cost(trial):
    study = load_study(Path("study.py"))
    return study.cost.score(flight(trial), study.mpc.input_scale).J


def stored():
    """Every row of the journal that counts."""
    with sqlite3.connect("runs/study/journal.sqlite") as database:
        return database.execute("SELECT * FROM trial ORDER BY number").fetchall()


def test_two_people_bring_a_campaign_to_its_end_from_the_shell(at_the_bench, socasadi):
    said = socasadi("init", "study.py")
    assert "6 trials of 1 s" in said
    assert "next        socasadi ask runs/study" in said

    # Ann and Bob each take a trial; Bob is back first.
    (first,), (second,) = asked(socasadi), asked(socasadi)
    assert (first["trial"], second["trial"]) == (1, 2)
    assert first["theta"] != second["theta"]
    said = socasadi("ask", "runs/study", "--pending")
    assert [line.split()[0] for line in said.splitlines()[1:]] == ["1", "2"]
    said = socasadi("tell", "runs/study", "--trial", 2, "--csv", recording(second))
    assert f"J = {cost(second):.5g}" in said
    assert "1 of 6 trials told, 1 out, 4 to be asked" in said

    # Bob's next one goes wrong.
    assert asked(socasadi)[0]["trial"] == 3
    said = socasadi("tell", "runs/study", "--trial", 3, "--failed", "cable [2] slipped off [/dev/ttyUSB0]")
    assert "trial 3     failed: cable [2] slipped off [/dev/ttyUSB0]" in said

    # Ann's log is in millimetres: refused, and nothing has happened.
    rows = [*csv.reader(Path(recording(first)).read_text().splitlines())]
    for row in rows[2:]:
        row[1:3] = [repr(1e3 * float(cell)) for cell in row[1:3]]
    with open("millimetres.csv", "w", newline="") as file:
        csv.writer(file).writerows(rows)
    before = stored()
    assert "is it in m?" in socasadi("tell", "runs/study", "--trial", 1, "--csv", "millimetres.csv", refused=True)
    assert stored() == before
    socasadi("tell", "runs/study", "--trial", 1, "--csv", recording(first))
    assert "nothing is out; 3 of 6 trials told" in socasadi("ask", "runs/study", "--pending")

    # Two at once from the model of J, brought back in the other order; one J was measured elsewhere.
    fourth, fifth = asked(socasadi, "--count", 2)
    assert (fourth["phase"], fifth["phase"]) == ("search", "search")
    assert fourth["theta"] != fifth["theta"]
    socasadi("tell", "runs/study", "--trial", 5, "--cost", cost(fifth))
    socasadi("tell", "runs/study", "--trial", 4, "--csv", recording(fourth))

    # Whatever computer the folder is on, the campaign goes on with the same point.
    shutil.copytree("runs/study", "elsewhere")
    with Campaign.open("elsewhere") as campaign:
        expected = campaign.ask().theta.tolist()
    (sixth,) = asked(socasadi)
    assert list(sixth["theta"].values()) == expected
    said = socasadi("tell", "runs/study", "--trial", 6, "--csv", recording(sixth))
    assert "6 of 6 trials told, 0 out, 0 to be asked" in said
    assert "socasadi export runs/study --out DIR" in said
    assert "all 6 trials of runs/study were asked" in socasadi("ask", "runs/study", refused=True)

    result = Result.open("runs/study")
    assert {trial.number: trial.outcome for trial in result.trials}[3] == "failed"
    for trial in (first, second, fourth, fifth, sixth):
        told = next(one for one in result.trials if one.number == trial["trial"])
        assert told.outcome == "cut" or cost(trial) == told.J
    assert [trial.number for trial in result.trials] == [2, 3, 1, 5, 4, 6]
    assert "failed: cable [2] slipped off [/dev/ttyUSB0]" in socasadi("show", "runs/study")
    if c_compiler():
        assert "largest difference from Python" in socasadi("export", "runs/study", "--out", "c")


def test_more_iterations_may_be_wanted_later(at_the_bench, socasadi):
    socasadi("init", "study.py", "--iterations", 0)
    for trial in asked(socasadi, "--count", 3):
        socasadi("tell", "runs/study", "--trial", trial["trial"], "--cost", 10 + trial["trial"])
    socasadi("ask", "runs/study", refused=True)
    assert "5 trials of 1 s" in socasadi("init", "study.py", "--resume", "--iterations", 2)
    assert asked(socasadi)[0]["trial"] == 4


def test_what_the_guide_shows_runs(at_the_bench, socasadi):
    guide = (Path(__file__).parent.parent / "studies" / "guide.md").read_text()
    section = guide.split("## With a robot of your own")[1].split("\n## ")[0]
    (script,) = re.findall(r"```python\n(.*?)```", section, re.S)
    (commands,) = re.findall(r"```\n(socasadi.*?)```", section, re.S)
    Path("arm.py").write_text(script)
    for line in commands.splitlines():
        words = shlex.split(line, comments=True)
        if words[1] == "tell" and "--csv" in words:
            about = json.loads(Path("runs/arm/asked/trial-001/theta.json").read_text())
            write_recording(flight(about, study="arm.py"), "recording.csv")
        socasadi(*words[1:])
    told = [*csv.DictReader(Path("trials.csv").read_text().splitlines())]
    assert [row["outcome"] for row in told] == ["done", "done", "failed"]
    assert float(told[1]["J"]) == 41.7
    assert Path("build/controller.h").exists()


def build(trial):
    """The experiment's program, by the command that the README of the sources gives."""
    Path("robot.c").write_text(ROBOT)
    sources = Path("runs/study/controller-c")
    line = next(line for line in (sources / "README.md").read_text().splitlines() if line.startswith("cc "))
    words = line.replace("-I. -ITRIAL", f"-I. -I{Path(trial['header']).parent.resolve()}").split()
    words = [*c_compiler(), "-Wall", "-Wextra", "-Wconversion", "-Werror", *words[1:]]
    words[words.index("robot.c")] = str(Path("robot.c").resolve())
    words[words.index("experiment", words.index("-o"))] = str(Path("experiment").resolve())
    return subprocess.run(words, cwd=sources, capture_output=True, text=True)


@with_compiler
@pytest.mark.parametrize(("real", "digits"), [("double", 1e-9), ("float", 1e-3)])
def test_a_program_in_c_that_flies_a_trial_brings_the_same_j_as_python(at_the_bench, socasadi, real, digits):
    socasadi("init", "study.py", "--real", real)
    # Without the numbers of a trial there is no program.
    nothing = {"header": "runs/study/asked/trial-001/controller_data.h"}
    assert "controller_data.h: No such file" in build(nothing).stderr
    sources = {file.name: file.read_bytes() for file in Path("runs/study/controller-c").iterdir()}
    for _ in range(3):
        (trial,) = asked(socasadi)
        built = build(trial)
        assert built.returncode == 0, built.stderr
        Path("log.csv").write_text(subprocess.run(["./experiment"], capture_output=True, text=True, check=True).stdout)
        socasadi("tell", "runs/study", "--trial", trial["trial"], "--csv", "log.csv")
        study = load_study(Path("study.py"))
        own = study.cost.score(flight(trial, noise=0.0), study.mpc.input_scale).J
        assert pytest.approx(own, rel=digits) == Result.open("runs/study").trials[-1].J
    assert {file.name: file.read_bytes() for file in Path("runs/study/controller-c").iterdir()} == sources


def test_ask_says_what_to_do_next(at_the_bench, socasadi):
    socasadi("init", "study.py")
    said = socasadi("ask", "runs/study")
    assert said.startswith("trial 1 of 6, a seed point:")
    assert "disturbance" not in said
    assert "frequency_y" in said
    assert "runs/study/asked/trial-001/controller_data.h, with the C in runs/study/controller-c" in said
    assert "CSV of 21 rows, t = 0 to 1 s every 0.05 s: t [s], y1 [m], y2 [m], u1 [N]" in said
    assert "socasadi tell runs/study --trial 1 --csv recording.csv" in said
    about = json.loads(Path("runs/study/asked/trial-001/theta.json").read_text())
    assert about["trial"] == 1
    header = Path("runs/study/asked/trial-001/controller_data.h").read_text()
    for name, value in about["theta"].items():
        assert f"{name} = {value!r}" in header
    assert "\n\ntrial 3 of 6" in socasadi("ask", "runs/study", "--count", 2)


def test_points_of_the_search_that_are_asked_in_ignorance_are_pointed_out(at_the_bench, socasadi, monkeypatch):
    said = []
    monkeypatch.setattr(cli.sys.stderr, "write", said.append)
    socasadi("init", "study.py")
    trials = asked(socasadi, "--count", 9)
    assert len(trials) == 6
    assert "asked in ignorance of the trials that are out, which are more than were told: trials 4 to 6" in "".join(
        said
    )
    for trial in trials:
        socasadi("tell", "runs/study", "--trial", trial["trial"], "--cost", 3.0 + trial["trial"])
    said.clear()
    socasadi("init", "study.py", "--resume", "--iterations", 5)
    assert len(asked(socasadi, "--count", 2)) == 2
    assert said == []


def test_who_flies_is_told_of_the_force_that_disturbs_the_task(at_the_bench, socasadi):
    text = Path("study.py").read_text()
    Path("study.py").write_text(text.replace("period=2.0", "period=2.0, pulse=Pulse(0.5, 0.2, (0, 1.5, 0))"))
    words = "at t = 0.5 s push the tip for 0.2 s with (0, 1.5, 0) N along x, y, z of the base"
    assert f"\ndisturbance {words}" in socasadi("init", "study.py")
    assert f"\ndisturbance {words}" in socasadi("ask", "runs/study")
    assert f"In each trial, {words}" in Path("runs/study/controller-c/README.md").read_text()
    assert asked(socasadi)[0]["pulse"] == {"time": 0.5, "duration": 0.2, "force": [0, 1.5, 0]}


def test_a_recording_that_ends_early_counts_once_it_proves_enough(at_the_bench, socasadi):
    socasadi("init", "study.py")
    (first,) = asked(socasadi)
    assert first["give_up"] is None
    socasadi("tell", "runs/study", "--trial", 1, "--cost", 0.01)
    (second,) = asked(socasadi)
    assert second["give_up"] == pytest.approx(0.1)
    lines = Path(recording(second)).read_text().splitlines()
    Path("short.csv").write_text("\n".join(lines[:12]) + "\n")
    said = socasadi("tell", "runs/study", "--trial", 2, "--csv", "short.csv")
    assert "cut: J is at least" in said
    assert "0.55 s were spared" in said
    assert "was spared 0:01 by cutting 1 hopeless trial" in socasadi("show", "runs/study")


def test_the_recording_of_another_trial_is_recognised(at_the_bench, socasadi):
    socasadi("init", "study.py")
    first, second, _ = asked(socasadi, "--count", 3)
    socasadi("tell", "runs/study", "--trial", 1, "--csv", recording(first))
    before = stored()
    for trial, theirs in ((2, recording(first)), (3, recording(second))):
        said = socasadi("tell", "runs/study", "--trial", trial, "--csv", theirs, refused=True)
        assert f"{theirs} holds the inputs of trial {trial - 1}'s controller, and not of trial {trial}'s" in said
    assert stored() == before


def test_inputs_of_nobody_are_taken_only_on_demand_and_rounded_ones_at_once(at_the_bench, socasadi):
    socasadi("init", "study.py")
    first, second = asked(socasadi, "--count", 2)
    episode = flight(first)
    shaken = np.clip(episode.tension + np.random.default_rng(0).normal(0, 3, episode.tension.shape), -10, 10)
    write_recording(replace(episode, tension=shaken), "shaken.csv")
    before = stored()
    said = socasadi("tell", "runs/study", "--trial", 1, "--csv", "shaken.csv", refused=True)
    assert re.search(r"trial 1's controller would have answered the outputs in shaken\.csv by other inputs", said)
    assert stored() == before
    socasadi("tell", "runs/study", "--trial", 1, "--csv", "shaken.csv", "--anyway")
    lines = [line.split(",") for line in Path(recording(second)).read_text().splitlines()]
    rounded = [[cell and f"{float(cell):.4f}" for cell in cells] for cells in lines[1:]]
    Path("rounded.csv").write_text("\n".join(map(",".join, [lines[0], *rounded])))
    socasadi("tell", "runs/study", "--trial", 2, "--csv", "rounded.csv")


def test_limits_are_measured_on_a_recording_and_told_with_a_cost(at_the_bench, socasadi):
    write_study(", limits=(Overshoot(0.004),), give_up=None")
    socasadi("init", "study.py")
    first, _ = asked(socasadi, "--count", 2)
    said = socasadi("tell", "runs/study", "--trial", 1, "--csv", recording(first))
    assert "overshoot" in said
    assert "kept" in said.lower()
    refused = socasadi("tell", "runs/study", "--trial", 2, "--cost", 9.5, refused=True)
    assert "overshoot" in refused
    said = socasadi("tell", "runs/study", "--trial", 2, "--cost", 9.5, "--measured", "overshoot=0.02")
    assert "overshoot 0.02 m, NOT kept: at most 0.004" in said
    rows = [*csv.DictReader(socasadi("show", "runs/study", "--csv", "-").splitlines())]
    assert float(rows[1]["overshoot [m]"]) == 0.02


def test_the_trials_are_exported_with_names_and_units(at_the_bench, socasadi):
    socasadi("init", "study.py")
    first, second, third = asked(socasadi, "--count", 3)
    socasadi("tell", "runs/study", "--trial", 2, "--csv", recording(second))
    socasadi("tell", "runs/study", "--trial", 1, "--failed", 'the "blue" cable, of course, broke')
    assert "trials.csv: 3 trials" in socasadi("show", "runs/study", "--csv", "trials.csv")
    rows = [*csv.DictReader(Path("trials.csv").read_text().splitlines())]
    assert [row["outcome"] for row in rows] == ["failed", "done", "pending"]
    assert rows[0]["failure"] == 'the "blue" cable, of course, broke'
    assert float(rows[1]["J"]) == cost(second)
    assert float(rows[1]["plant_seconds [s]"]) == pytest.approx(1.0)
    units = first["units"]
    for trial, row in zip((first, second, third), rows, strict=True):
        for name, value in trial["theta"].items():
            heading = name if units[name] == "1" else f"{name} [{units[name]}]"
            assert float(row[heading]) == value
    assert np.isfinite(float(rows[1]["rmse [m]"]))


def test_a_task_of_ones_own_takes_the_script_along(at_the_bench, socasadi):
    text = Path("study.py").read_text()
    own = "from dataclasses import dataclass\n@dataclass(frozen=True, kw_only=True)\nclass Mine(Circle): pass\n"
    Path("study.py").write_text(text.replace("arm =", own + "arm =").replace("Circle(duration", "Mine(duration"))
    assert "socasadi ask runs/study --study study.py" in socasadi("init", "study.py", "--iterations", 1)
    assert "Mine can only be made by the study script" in socasadi("ask", "runs/study", refused=True)
    (trial,) = asked(socasadi, "--study", "study.py")
    said = socasadi("tell", "runs/study", "--trial", trial["trial"], "--cost", 3.0, "--study", "study.py")
    assert "1 of 4 trials told" in said
    assert "name it by --study" in socasadi("show", "runs/study", refused=True)
    assert "1 of 4 trials so far" in socasadi("show", "runs/study", "--study", "study.py")
    assert "\n1,seed,done,3.0," in socasadi("show", "runs/study", "--csv", "-", "--study", "study.py")
    Path("other.py").write_text(Path("study.py").read_text().replace("period=2.0", "period=3.0"))
    assert "period" in socasadi("show", "runs/study", "--study", "other.py", refused=True)


def test_an_ask_that_was_broken_off_is_made_whole(at_the_bench, socasadi):
    socasadi("init", "study.py")
    (trial,) = asked(socasadi)
    header = Path(trial["header"])
    text = header.read_text()
    shutil.rmtree("runs/study/asked")
    assert "trial-001" in socasadi("ask", "runs/study", "--pending")
    assert header.read_text() == text


def test_a_damaged_note_of_the_number_type_is_said(at_the_bench, socasadi):
    socasadi("init", "study.py", "--real", "float")
    Path("runs/study/controller.json").write_text("{")
    assert "runs/study/controller.json is damaged" in socasadi("ask", "runs/study", refused=True)


def test_a_theta_without_a_controller_is_told_as_failed_and_the_next_is_asked(at_the_bench, socasadi, monkeypatch):
    lay_out = Bench.lay_out

    def refuse_the_first(bench, asked):
        if asked.number == 1:
            raise DesignError("the model gives no controller: its gain is singular")
        return lay_out(bench, asked)

    socasadi("init", "study.py")
    monkeypatch.setattr(Bench, "lay_out", refuse_the_first)
    said = socasadi("ask", "runs/study")
    assert said.startswith("trial 1 has failed without being flown: the model gives no controller")
    assert "trial 2 of 6" in said
    (trial,) = Result.open("runs/study").trials
    assert trial.failure == "DesignError: the model gives no controller: its gain is singular"


def test_what_was_flown_elsewhere_is_drawn_as_anything_else(at_the_bench, socasadi):
    socasadi("init", "study.py")
    (trial,) = asked(socasadi)
    socasadi("tell", "runs/study", "--trial", 1, "--csv", recording(trial))
    assert "path.png" in socasadi("plot", "runs/study")


def test_a_robot_that_python_never_touches_cannot_be_run(at_the_bench, socasadi):
    said = socasadi("run", "study.py", refused=True)
    assert "the arm in room 12 cannot be flown from here: bring its experiments by `socasadi init`, `ask` and" in said


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("ask", "nowhere"), "there is no run folder nowhere"),
        (("tell", "nowhere", "--trial", 1, "--cost", 3), "there is no run folder nowhere"),
        (("ask", "."), ". is no run folder: it has no study.json"),
        (("ask", "runs/study", "--count", 0), "--count is at least 1, not 0"),
        (("ask", "runs/study", "--study", "nowhere.py"), "there is no study script nowhere.py"),
        (("init", "study.py"), "runs/study exists already"),
        (("init", "nowhere.py"), "there is no study script nowhere.py"),
        (("init", "study.py", "--real", "half", "--out", "x"), "unknown real 'half'; there are double, float"),
        (("tell", "runs/study", "--trial", 2, "--cost", 3), "trial 2 of runs/study was never asked; not told yet: 1"),
        (("tell", "runs/study", "--trial", 2, "--cost", 3), "ask first: socasadi ask runs/study"),
        (("tell", "runs/study", "--trial", 1, "--cost", "nan"), "nan"),
        (("tell", "runs/study", "--trial", 1, "--cost", "nan"), "is told by --failed REASON"),
        (("plot", "runs/study"), "no trial of runs/study was told yet, 1 is out"),
        (("tell", "runs/study", "--trial", 1), "exactly one of --csv FILE, --cost J, --failed REASON and --take-back"),
        (("tell", "runs/study", "--trial", 1, "--cost", 3, "--csv", "a.csv"), "exactly one of --csv FILE, --cost J"),
        (("tell", "runs/study", "--trial", 1, "--csv", "nowhere.csv"), "there is no recording nowhere.csv"),
        (("tell", "runs/study", "--trial", 1, "--csv", "."), "directory"),
        (("tell", "runs/study", "--trial", 1, "--failed", " "), "--failed takes the reason"),
        (("tell", "runs/study", "--trial", 1, "--cost", 3, "--anyway"), "--anyway goes with --csv"),
        (("tell", "runs/study", "--trial", 1, "--failed", "no", "--measured", "a=1"), "--measured goes with --cost"),
        (("tell", "runs/study", "--trial", 1, "--cost", 3, "--measured", "a"), "--measured takes NAME=VALUE"),
        (("show", "runs/study", "--csv", "no/where.csv"), "no/where.csv"),
        (("run", "study.py", "--jobs", 0), "--jobs is at least 1, not 0"),
        (("run", "study.py", "--start", "nowhere"), "there is no run folder nowhere"),
    ],
)
def test_a_mistake_is_answered_by_one_sentence_and_changes_nothing(at_the_bench, socasadi, arguments, words):
    socasadi("init", "study.py")
    asked(socasadi)
    before = stored()
    assert words in socasadi(*arguments, refused=True)
    assert stored() == before


@pytest.mark.parametrize("command", [("plot",), ("export", "--out", "c"), ("emulate",)])
def test_a_run_without_trials_says_how_to_begin(at_the_bench, socasadi, command):
    socasadi("init", "study.py")
    words = "runs/study has no trials yet: ask and tell (socasadi ask runs/study)\n"
    assert socasadi("show", "runs/study") == words
    assert socasadi(command[0], "runs/study", *command[1:], refused=True) == f"socasadi: {words}"


@pytest.mark.parametrize(("factor", "hinted"), [(1000, True), (1.5, False), (1e6, False)])
def test_inputs_in_millinewtons_are_guessed(at_the_bench, socasadi, factor, hinted):
    socasadi("init", "study.py")
    (trial,) = asked(socasadi)
    episode = flight(trial)
    tension = factor * 8 * episode.tension / np.abs(episode.tension).max()
    write_recording(replace(episode, tension=tension), "wrong.csv")
    said = socasadi("tell", "runs/study", "--trial", 1, "--csv", "wrong.csv", refused=True)
    assert "beyond its bounds -10 and 10 N" in said
    assert ("is it in mN?" in said) == hinted


def test_what_was_told_is_not_told_again(at_the_bench, socasadi):
    socasadi("init", "study.py")
    asked(socasadi)
    socasadi("tell", "runs/study", "--trial", 1, "--cost", 5)
    said = socasadi("tell", "runs/study", "--trial", 1, "--cost", 4, refused=True)
    assert "trial 1 of runs/study was told already" in said


def test_what_was_told_wrong_is_taken_back_and_told_anew(at_the_bench, socasadi):
    socasadi("init", "study.py")
    asked(socasadi)
    socasadi("tell", "runs/study", "--trial", 1, "--cost", 0.5)
    both = ("--cost", 5, "--take-back")
    assert "exactly one of" in socasadi("tell", "runs/study", "--trial", 1, *both, refused=True)
    said = socasadi("tell", "runs/study", "--trial", 1, "--take-back")
    assert "trial 1     was told as J = 0.5; that is taken back" in said
    assert "0 of 6 trials told, 1 out, 5 to be asked" in said
    assert "taken back: trial 1, told as J = 0.5" in socasadi("show", "runs/study")
    assert "best        J = 5, trial 1" in socasadi("tell", "runs/study", "--trial", 1, "--cost", 5)
    assert "nothing was told of trial 2" in socasadi("tell", "runs/study", "--trial", 2, "--take-back", refused=True)
