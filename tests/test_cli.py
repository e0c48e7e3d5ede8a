"""The command, as a user runs it."""

import json
import re
import shutil
import signal
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

import numpy as np
import pytest
from command_support import socasadi
from PIL import Image

from socasadi.campaign import Journal, Result
from socasadi.codegen import c_compiler
from socasadi.export import toolchain

ROOT = Path(__file__).parent.parent
STUDY = """
from socasadi import *
plant = SimulatedPlant(Rod.preset("{rod}"))
mpc = LinearMPC(Modal.from_spec(length=0.6, bending_stiffness=0.64, mass_per_length=2.8, cable_offset=0.02), {mpc})
study = Study(plant=plant, mpc=mpc, task={task}, seed_points={seed_points}, iterations={iterations}, verifications=1)
"""


def study(folder, *, rod="paper", mpc="", task="Circle(duration=1.0)", seed_points=4, iterations=2, name="study.py"):
    script = folder / name
    script.write_text(STUDY.format(rod=rod, mpc=mpc, task=task, seed_points=seed_points, iterations=iterations))
    return script


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    folder = tmp_path_factory.mktemp("cli")
    return folder, socasadi("run", study(folder), cwd=folder)


def test_run_ends_with_the_theta_the_figures_and_a_checked_controller(finished):
    folder, run = finished
    assert run.returncode == 0, run.stderr
    assert "trial 6/6" in run.stdout
    assert "best of 6 Sobol points" in run.stdout
    assert re.search(r"frequency_y +[\d.]+ +rad/s", run.stdout)
    assert {"best", "Sobol", "identified"} <= set(run.stdout.split())
    figures = folder / "runs" / "study" / "figures"
    names = {"convergence", "responses", "path", "inputs", "shapes"}
    assert {file.name for file in figures.iterdir()} == {f"{name}.{kind}" for name in names for kind in ("png", "pdf")}
    if c_compiler():
        assert "passed: 20 samples of the episode and 200 random ones, 0 clipped, 0 held" in run.stdout


def test_show_plot_and_export_need_the_run_folder_alone(finished, tmp_path):
    folder, _ = finished
    run = shutil.copytree(folder / "runs" / "study", tmp_path / "moved")
    shown = socasadi("show", run, cwd=tmp_path)
    assert shown.returncode == 0
    assert "best" in shown.stdout
    assert "complete" in shown.stdout
    assert re.search(r"flown under fresh noise:.*\n.*\n +trial \d +1 ", shown.stdout)
    drawn = socasadi("plot", run, "--trial", 2, cwd=tmp_path)
    assert drawn.returncode == 0
    assert "drawn is the episode of trial 2" in drawn.stdout
    exported = socasadi("export", run, "--out", "c", cwd=tmp_path)
    assert exported.returncode == 0, exported.stderr
    assert (tmp_path / "c" / "controller.h").exists()


def test_it_tells_its_version(tmp_path):
    told = socasadi("--version", cwd=tmp_path)
    assert (told.returncode, told.stdout) == (0, f"socasadi {version('socasadi')}\n")


def test_report_says_what_it_lacks_and_fails_on_damage_alone(finished, tmp_path):
    folder, _ = finished
    run = shutil.copytree(folder / "runs" / "study", tmp_path / "run")
    whole = socasadi("report", run, cwd=tmp_path)
    assert (whole.returncode, whole.stderr) == (0, "")
    shutil.rmtree(run / "sobol")
    without = socasadi("report", run, cwd=tmp_path)
    assert without.returncode == 0
    assert without.stderr.startswith("What this report lacks:\n  the Sobol baseline: there is no ")
    (run / "journal.sqlite").write_bytes((run / "journal.sqlite").read_bytes()[:9000])
    damaged = socasadi("report", run, cwd=tmp_path)
    assert damaged.returncode == 1
    assert "report.html: " in damaged.stdout
    assert "\n  the journal: " in damaged.stderr


def test_show_draws_the_costs_and_says_where_things_lie(finished):
    folder, _ = finished
    run = Path("runs") / "study"
    best = Result.open(folder / run).best.number
    shown = socasadi("show", run, cwd=folder, PYTHONIOENCODING="utf-8")
    legend, line, pointer = re.search(r"\n(J over the trials: .*)\n(.*)\n(.*)\n", shown.stdout).groups()
    assert "▁" in legend
    assert len(line) == 6
    assert line[best - 1] == "▁"
    assert pointer.index("^") == best - 1
    places = dict(re.findall(r"^  (\w+(?: \w+)?) +(runs/study/[\w.]+)", shown.stdout, re.M))
    assert places == {
        "journal": "runs/study/journal.sqlite",
        "figures": "runs/study/figures",
        "controller": "runs/study/controller",
        "Sobol points": "runs/study/sobol",
    }
    assert "figures: convergence, inputs, path, responses, shapes" in shown.stdout


def test_show_reads_where_only_ascii_can_be_printed(finished, tmp_path):
    folder, _ = finished
    shutil.copytree(folder / "runs" / "study", tmp_path / "für")
    shown = socasadi("show", "für", cwd=tmp_path, PYTHONIOENCODING="ascii", PYTHONUTF8="1")
    assert shown.returncode == 0, shown.stderr
    assert "f\\xfcr: complete" in shown.stdout
    assert re.search(r"\nJ over the trials: \. .*\n[.:=+*#>x-]{6}\n", shown.stdout)


def test_plot_animates_one_episode_and_only_with_a_suffix_that_it_knows(finished, tmp_path):
    folder, _ = finished
    animated = socasadi("plot", "runs/study", "--animate", tmp_path / "talk" / "one.gif", "--trial", 2, cwd=folder)
    assert animated.returncode == 0, animated.stderr
    assert re.fullmatch(r".*one\.gif: [\d.]+ MB\n", animated.stdout)
    with Image.open(tmp_path / "talk" / "one.gif") as image:
        assert (image.n_frames, image.size) == (11, (1280, 720))
    refused = socasadi("plot", "runs/study", "--animate", tmp_path / "one.webm", cwd=folder)
    assert refused.returncode == 1
    assert re.fullmatch(r"socasadi: the animation .*one\.webm ends in '\.webm'; take \.gif or \.mp4\n", refused.stderr)


@pytest.mark.slow
def test_a_robot_that_only_pulls_and_one_that_hangs_work_through_the_whole_line(tmp_path):
    script = study(tmp_path, rod="hanging", mpc="input_bounds=(0, 10)", task="Circle(radius=0.015, duration=1.0)")
    run = socasadi("run", script, cwd=tmp_path)
    assert run.returncode == 0, run.stderr
    with Journal(tmp_path / "runs" / "study" / "journal.sqlite") as journal:
        for trial in journal.trials():
            tension = journal.episode(trial.number).tension
            assert tension.min() >= 0
            assert tension.max() <= 10


def test_without_a_compiler_it_says_so_once_and_gives_the_same_numbers(finished, tmp_path):
    folder, _ = finished
    nothing = tmp_path / "bin"
    nothing.mkdir()
    run = socasadi("run", study(tmp_path, iterations=1), cwd=tmp_path, PATH=str(nothing), CC="")
    assert run.returncode == 0, run.stderr
    assert run.stderr.count("no C compiler found") == 1
    assert "was not built: no C compiler found" in run.stdout
    with (
        Journal(folder / "runs" / "study" / "journal.sqlite") as compiled,
        Journal(tmp_path / "runs" / "study" / "journal.sqlite") as interpreted,
    ):
        one, other = ([trial.J for trial in journal.trials()] for journal in (compiled, interpreted))
    np.testing.assert_allclose(one[:4], other[:4], rtol=1e-9)
    # Where the search asks next hangs on the last bits of these, by way of where a descent ends.
    np.testing.assert_allclose(one[4:5], other[4:], rtol=1e-4)


def test_ctrl_c_says_how_to_go_on_and_going_on_finishes(tmp_path):
    script = study(tmp_path, seed_points=30, iterations=0)
    command = [sys.executable, "-u", "-m", "socasadi.cli", "run", str(script)]
    process = subprocess.Popen(command, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    while not process.stdout.readline().startswith("trial  3/30"):
        assert process.poll() is None
    process.send_signal(signal.SIGINT)
    said, _ = process.communicate(timeout=60)
    assert process.returncode == 130
    assert "go on with: socasadi run" in said
    assert "--resume" in said
    assert "Traceback" not in said
    again = socasadi("run", script, "--resume", cwd=tmp_path)
    assert again.returncode == 0, again.stderr
    with Journal(tmp_path / "runs" / "study" / "journal.sqlite") as journal:
        assert [trial.number for trial in journal.trials()] == list(range(1, 31))


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("run", "nowhere.py"), "there is no study script nowhere.py"),
        (("run", "."), ". is a folder; name the Python file that defines the study"),
        (("run", "arm.toml"), "arm.toml is no Python file (.py); name the one that defines the study"),
        (("check", "arm.toml"), "arm.toml is no Python file (.py); name the one that defines the study"),
        (("run", "empty.py"), "empty.py defines no `study`"),
        (("run", "unknown.py"), "no preset is called 'papre'; there are paper, hanging, paper_literal"),
        (("run", "crossing.py"), "input_bounds cross: lower 10 is not below upper -10"),
        (("run", "broken.py"), "broken.py, line 2: NameError: name 'stuudy' is not defined"),
        (("run", "syntax.py"), "syntax.py, line 1: "),
        (("run", "beside.py"), "beside.py defines no `study`"),
        (("run", "backend.py"), "unknown QP back end 'gurobi'; there are active-set, daqp, qpoases, osqp"),
        (("show", "nowhere"), "there is no run folder nowhere"),
        (("plot", "."), ". is no run folder: it has no study.json"),
        (("export", "nowhere", "--out", "c"), "there is no run folder nowhere"),
    ],
)
def test_a_mistake_is_answered_by_one_sentence(tmp_path, arguments, words):
    (tmp_path / "empty.py").write_text("")
    (tmp_path / "arm.toml").write_text("length = 0.6\n")
    (tmp_path / "broken.py").write_text("a = 1\nstuudy\n")
    (tmp_path / "syntax.py").write_text("study = (\n")
    (tmp_path / "beside.py").write_text("import empty\n")
    study(tmp_path, rod="papre", name="unknown.py")
    study(tmp_path, mpc="input_bounds=(10, -10)", name="crossing.py")
    study(tmp_path, mpc="backend='gurobi'", name="backend.py")
    run = socasadi(*arguments, cwd=tmp_path)
    assert run.returncode == 1
    assert words in run.stderr
    assert run.stderr.startswith("socasadi: ")
    assert len(run.stderr.strip().splitlines()) == 1


@pytest.mark.parametrize(
    "options", [("--real", "float"), pytest.param(("--solver", "osqp"), marks=pytest.mark.slow), ("--name", "arm")]
)
def test_a_run_is_exported_in_every_way(finished, tmp_path, options):
    if "osqp" in options:
        pytest.importorskip("osqp", reason="the package osqp is not installed")
    folder, _ = finished
    run = socasadi("export", folder / "runs" / "study", "--out", tmp_path / "c", *options, cwd=tmp_path)
    assert run.returncode == 0, run.stderr
    assert "largest difference from Python" in run.stdout


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--real", "half"), "unknown real 'half'; there are double, float"),
        (("--solver", "qrqp"), "unknown solver 'qrqp'; there are active-set, osqp"),
        (("--name", "9"), "the name '9' does not do for C"),
    ],
)
def test_what_cannot_be_exported_is_said(finished, tmp_path, options, said):
    folder, _ = finished
    run = socasadi("export", folder / "runs" / "study", "--out", tmp_path / "c", *options, cwd=tmp_path)
    assert run.returncode == 1
    assert said in run.stderr


@pytest.mark.skipif(toolchain() is not None, reason=f"no emulated microcontroller: {toolchain()}")
@pytest.mark.parametrize(("real", "core"), [("float", "cortex-m4"), ("double", "cortex-m7")])
def test_a_run_flies_with_its_controller_on_an_emulated_microcontroller(finished, real, core):
    folder, _ = finished
    run = socasadi("emulate", "runs/study", "--real", real, cwd=folder)
    assert run.returncode == 0, run.stderr
    assert core in run.stdout
    assert "0.0e+00 of the bound" in run.stdout
    kept = json.loads((folder / "runs" / "study" / f"microcontroller-{real}.json").read_text())
    assert kept["difference"] == 0
    assert kept["episode"]["instructions_median"] <= kept["episode"]["instructions_worst"]
    assert kept["worst"]["instructions_worst"] > 2 * kept["episode"]["instructions_median"]


def test_without_the_cross_compiler_the_packages_are_named(finished, monkeypatch):
    folder, _ = finished
    monkeypatch.setenv("PATH", str(folder / "nothing"))
    run = socasadi("emulate", "runs/study", cwd=folder)
    assert run.returncode == 1
    assert "apt-get install gcc-arm-none-eabi" in run.stderr


def test_a_run_folder_that_exists_needs_resume_and_the_same_settings(finished):
    folder, _ = finished
    again = socasadi("run", "study.py", cwd=folder)
    assert again.returncode == 1
    assert "exists already; resume it (--resume)" in again.stderr
    other = socasadi("run", "study.py", "--resume", "--seed", 5, cwd=folder)
    assert other.returncode == 1
    assert "other settings: seed was 0 and is 5" in other.stderr
    fewer = socasadi("run", "study.py", "--resume", "--iterations", 1, cwd=folder)
    assert fewer.returncode == 1
    assert "holds 6 trials already; ask for no fewer, not for 5" in fewer.stderr
    # Before anything else is done or said.
    assert again.stdout + other.stdout + fewer.stdout == ""


def test_what_the_readme_and_the_guide_show_of_python_runs(tmp_path):
    (code,) = re.findall(r"```python\n(.*?)```", (ROOT / "README.md").read_text(), re.S)
    others = re.findall(r"```python\n(.*?)```", (ROOT / "studies" / "guide.md").read_text(), re.S)
    assert len(others) == 7
    # One process, since each would spend most of its time on imports; each block has its own names.
    each = "\n".join(
        f"exec(compile({block!r}, 'block {i}', 'exec'), {{'__name__': '__main__'}})" for i, block in enumerate(others)
    )
    run = subprocess.run([sys.executable, "-c", each], cwd=tmp_path, capture_output=True, text=True)
    assert run.returncode == 0, run.stderr
    assert "casadi_real" in (tmp_path / "rhs.c").read_text()
    short = code.replace("iterations=20", "iterations=1, seed_points=2")
    assert short != code
    run = subprocess.run([sys.executable, "-c", short], cwd=tmp_path, capture_output=True, text=True)
    assert run.returncode == 0, run.stderr
    assert (tmp_path / "build" / "controller.h").exists()


def test_the_best_of_an_earlier_run_is_tried_first_and_processes_share_the_trials(finished, tmp_path):
    folder, _ = finished
    earlier = Result.open(folder / "runs" / "study")
    script = study(tmp_path)
    run = socasadi("run", script, "--start", folder / "runs" / "study", "--jobs", 2, cwd=tmp_path)
    assert run.returncode == 0, run.stderr
    trials = sorted(Result.open(tmp_path / "runs" / "study").trials, key=lambda trial: trial.number)
    np.testing.assert_array_equal(trials[0].theta, earlier.chosen.theta)
    assert len(trials) == 6


def test_a_start_that_does_not_fit_is_said(finished, tmp_path):
    folder, _ = finished
    script = study(tmp_path)
    script.write_text(script.read_text().replace("length=0.6", "length=6.0"))
    run = socasadi("run", script, "--start", folder / "runs" / "study", cwd=tmp_path)
    assert run.returncode == 1
    assert "cannot be a start: its frequency_y is" in run.stderr
    assert "outside this study's bounds" in run.stderr
    script.write_text(
        "from socasadi import *\nstudy = Study(plant=ExternalPlant(.05, 3, 2), mpc=LinearMPC(Dense()), task=Circle())\n"
    )
    run = socasadi("run", script, "--start", folder / "runs" / "study", cwd=tmp_path)
    assert run.returncode == 1
    assert "cannot be a start: its theta is frequency_y rad/s" in run.stderr


@pytest.mark.slow
def test_a_run_begun_by_python_goes_on_by_the_command_with_a_robot_of_ones_own(tmp_path):
    script = study(tmp_path, seed_points=3, iterations=0)
    own = "class Arm(SimulatedPlant): pass\nplant = Arm("
    text = script.read_text().replace("plant = SimulatedPlant(", own)
    script.write_text(text + "if __name__ == '__main__': study.run('runs/study')\n")
    assert subprocess.run([sys.executable, script], cwd=tmp_path, capture_output=True).returncode == 0
    again = socasadi("run", script, "--resume", cwd=tmp_path)
    assert again.returncode == 0, again.stderr
    for command in (["show", "runs/study"], ["export", "runs/study", "--out", "c"]):
        assert socasadi(*command, cwd=tmp_path).returncode == 0
