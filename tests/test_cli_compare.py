"""`socasadi compare` as a user meets it."""

import csv
from pathlib import Path

import pytest
from command_support import socasadi

from socasadi.baselines import Summary, fitting_cells, load_comparison, stored_cells, summary_table
from socasadi.codegen import c_compiler

NOTHING = """
from socasadi import Circle, LinearMPC, Modal, Rod, SimulatedPlant, Study
from socasadi.baselines import Comparison, DeadCable, Identified

study = Study(plant=SimulatedPlant(Rod.preset("paper")), mpc=LinearMPC(Modal()), task=Circle(duration=1.0))
comparison = Comparison(
    study=study,
    tasks={"circle": study.task},
    methods={"too long": Identified(probing=20.0)},
    seeds=(0,),
    checkpoints=(1, 2),
    elsewhere={"dead": DeadCable()},
    elsewhere_on=("circle",),
)
"""
ROOT = Path(__file__).parents[1]


def compare(*arguments, cwd, alone=False):
    return socasadi("compare", *arguments, cwd=cwd, alone=alone)


WHOLE = load_comparison(ROOT / "studies" / "compare.py", "smoke")
ALIKE = {
    *("socasadi (Sobol)", "socasadi (random)", "socasadi (careful)", "for the mean", "Sobol", "random", "weights"),
    *("velocity DeePC", "linearised", "linearised (tuned)", "nonlinear MPC"),
}
"""Methods that others share their code with."""
FEW = (["circle"], [method for method in WHOLE.methods if method not in ALIKE])


@pytest.fixture(scope="module", params=[FEW, pytest.param((WHOLE.tasks, WHOLE.methods), marks=pytest.mark.slow)])
def smoke(request, tmp_path_factory):
    """Where it was flown, what of it, and how the command ended."""
    folder, (tasks, methods) = tmp_path_factory.mktemp("compare"), request.param
    only = [f"--{kind}={name}" for kind, names in (("task", tasks), ("method", methods)) for name in names]
    done = compare(ROOT / "studies" / "compare.py", "--smoke", "--jobs=1", *only, cwd=folder, alone=True)
    return folder, request.param, done


pytestmark = pytest.mark.skipif(c_compiler() is None, reason="some methods are solved in C")


def test_every_method_brings_a_controller_in_the_smoke_comparison(smoke):
    folder, (tasks, methods), done = smoke
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    with (folder / "runs" / "compare-smoke" / "table.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert {row["method"] for row in rows} == set(methods)
    assert {row["task"] for row in rows} == set(tasks)
    assert all(float(row["J"]) < 60 for row in rows)
    # Who tunes anything has flown a trial and more, after what its model is fitted to.
    cells = list(stored_cells(folder / "runs" / "compare-smoke"))
    assert all(cell["flights"] > 4 for cell in cells if cell["method"] not in ("identified", "N4SID", "linearised"))
    assert all(row["failed"].startswith("0 of") for row in rows)
    with (folder / "runs" / "compare-smoke" / "against.csv").open() as file:
        rivals = {row["method"] for row in csv.DictReader(file)}
    assert rivals == {row["method"] for row in rows} - {"socasadi"}
    assert {row["size"] for row in rows} == {"smoke"}
    assert "[1/" in done.stdout
    assert "left" in done.stdout


def test_its_figures_are_drawn(smoke):
    folder, _, _ = smoke
    figures = folder / "runs" / "compare-smoke" / "figures"
    assert {file.stem for file in figures.glob("*.png")} == {
        "cost",
        "rmse",
        "methods",
        "paths",
        "distances",
        "elsewhere",
    }
    assert all(file.stat().st_size > 5000 for file in figures.glob("*.png"))


def test_given_again_it_flies_nothing_and_tells_the_same(smoke):
    folder, (tasks, methods), done = smoke
    only = [f"--{kind}={name}" for kind, names in (("task", tasks), ("method", methods)) for name in names]
    again = compare(ROOT / "studies" / "compare.py", "--smoke", *only, cwd=folder)
    assert "[1/" not in again.stdout
    assert again.stdout.splitlines()[-30:] == done.stdout.splitlines()[-30:]


def test_a_method_that_has_nothing_to_offer_is_told_as_that(tmp_path):
    (tmp_path / "script.py").write_text(NOTHING)
    done = compare("script.py", "--jobs", "1", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "no controller within its time" in done.stdout
    assert (tmp_path / "runs" / "script-full" / "figures" / "cost.png").exists()


@pytest.mark.parametrize(
    ("arguments", "fault"),
    [
        (("nowhere.py",), "there is no study script nowhere.py"),
        ((ROOT / "studies" / "circle.py",), "defines no `comparison`"),
        ((ROOT / "studies" / "compare.py", "--smoke", "--quick"), "give one"),
        ((ROOT / "studies" / "compare.py", "--jobs", "0"), "--jobs is at least 1"),
    ],
)
def test_a_slip_is_answered_in_a_sentence(tmp_path, arguments, fault):
    done = compare(*arguments, cwd=tmp_path)
    assert done.returncode == 1
    assert fault in done.stderr
    assert "Traceback" not in done.stderr


def test_what_is_committed_was_flown_under_the_settings_that_are_committed():
    """Every stored cell is one of the comparison as it stands, whole seeds of it, and the table is made of them."""
    results = ROOT / "studies" / "results" / "compare"
    comparison, stored = load_comparison(ROOT / "studies" / "compare.py"), list(stored_cells(results))
    seeds = sorted({cell["seed"] for cell in stored})
    flown = comparison.of_parts(seeds=len(seeds))
    assert len(fitting_cells(flown, results)) == len(flown.cells) == len(stored)
    with (results / "table.csv").open() as file:
        rows = list(csv.DictReader(file))
    made = summary_table(Summary.of(stored, list(comparison.tasks), list(comparison.methods)))
    assert rows == [{"size": "full", **row} for row in made]
