"""`socasadi compare` as a user meets it."""

import csv
from pathlib import Path

import pytest
from command_support import socasadi

from socasadi.baselines import load_comparison, stored_cells
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
    *("velocity DeePC", "ILC (untuned)", "linearised", "linearised (tuned)", "nonlinear MPC"),
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


BROKEN = """
from socasadi import Circle, LinearMPC, Modal, Rod, SimulatedPlant, Study
from socasadi.baselines import Comparison, Linearised, Method

class Broken(Method):
    def offers(self, lab):
        yield 1 / 0

study = Study(plant=SimulatedPlant(Rod.preset("paper")), mpc=LinearMPC(Modal()), task=Circle(duration=1.0))
comparison = Comparison(
    study=study,
    tasks={"circle": study.task},
    methods={"linearised": Linearised(), "broken": Broken()},
    seeds=(0,),
    checkpoints=(1,),
    flights=1,
)
"""


def test_what_is_there_is_told_first_what_broke_at_last_and_nothing_stays_of_a_comparison_before(tmp_path):
    (script := tmp_path / "script.py").write_text(BROKEN)
    done, folder = compare("script.py", "--jobs", "1", cwd=tmp_path), tmp_path / "runs" / "script-full"
    assert done.returncode == 1
    assert "broke off: circle, broken, seed 0: ZeroDivisionError: division by zero (script.py, line 7)" in done.stdout
    assert "are there" not in done.stdout
    old = [folder / name for name in ("against.csv", "elsewhere-old.csv", "figures/elsewhere-old.png")]
    kept = [folder / name for name in ("notes.csv", "figures/mine.png")]
    for file in (*old[1:], *kept):
        file.touch()
    assert old[0].exists()
    with (folder / "table.csv").open() as file:
        assert [row["broke"] for row in csv.DictReader(file)] == ["0 of 1", "1 of 1"]
    script.write_text(BROKEN.replace(', "broken": Broken()', ""))
    again = compare("script.py", "--jobs", "1", cwd=tmp_path)
    assert again.returncode == 0, again.stderr
    assert "1 of 1 cells are there; 1 that were flown under other settings are left aside" in again.stdout
    assert [file.exists() for file in (*old, *kept)] == [False, False, False, True, True]


SILENT = """
import numpy as np
from socasadi import Circle, LinearMPC, Modal, Rod, SimulatedPlant, Study
from socasadi.baselines import Comparison, Law, Method

class Late(Law):
    def begin(self):
        self.left = 3

    def act(self, y, reference):
        self.left -= 1
        return np.full(self.mpc.inputs, np.nan if self.left >= 0 else 1.0)

class Silent(Method):
    def offers(self, lab):
        yield Late(lab.study.mpc)

study = Study(plant=SimulatedPlant(Rod.preset("paper")), mpc=LinearMPC(Modal()), task=Circle(duration=1.0))
comparison = Comparison(
    study=study, tasks={"circle": study.task}, methods={"silent": Silent()}, seeds=(0,), checkpoints=(1,), flights=2
)
"""


def test_how_often_a_controller_had_no_answer_is_told(tmp_path):
    """Three samples in each of two flights."""
    (tmp_path / "script.py").write_text(SILENT)
    done = compare("script.py", "--jobs", "1", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "no answer of its own in 6 samples: circle, silent, seed 0: J = " in done.stdout


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
