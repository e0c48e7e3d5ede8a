"""The scripts of studies/ run, and their tables and figures say what the runs say."""

import csv
import subprocess
import sys
from pathlib import Path

import matplotlib.image
import numpy as np
import pytest

from socasadi.campaign import Result

STUDIES = Path(__file__).parents[1] / "studies"
FIGURES = {"paper-origin-convergence", "paper-origin-responses", "paper-circle-convergence", "paper-circle-path"}


@pytest.fixture(scope="module")
def smoke(tmp_path_factory):
    """Folder and printed words of the smoke test of studies/paper.py."""
    folder = tmp_path_factory.mktemp("paper")
    command = [sys.executable, str(STUDIES / "paper.py"), "--smoke", "--seeds", "3", "--out", str(folder)]
    done = subprocess.run(command, capture_output=True, text=True, cwd=folder, timeout=300)
    assert done.returncode == 0, done.stderr
    return folder, done.stdout


def test_paper_draws_the_four_figures_of_the_paper_at_a_columns_width(smoke):
    folder, words = smoke
    files = {file.stem: file for file in (folder / "figures").iterdir()}
    assert set(files) == FIGURES
    for file in files.values():
        assert str(file) in words
        assert file.stat().st_size < 60e3
        pixels = matplotlib.image.imread(file)[:, :, :3]
        assert abs(pixels.shape[1] - 88 / 25.4 * 220) <= 2
        coloured = np.ptp(pixels, axis=2) > 0.5
        assert {bool(red > blue) for red, _, blue in pixels[coloured]} == {True, False}, "not both searches are drawn"


def test_paper_searches_start_from_the_same_seed_points_and_differ_in_nothing_else(smoke):
    folder, _ = smoke
    for scenario in ("origin", "circle"):
        runs = [Result.open(folder / f"{scenario}-{search}-3") for search in ("paper", "bayesian", "sobol")]
        thetas = [[trial.theta for trial in run.trials if trial.number <= 2] for run in runs]
        costs = [[trial.J for trial in run.trials if trial.number <= 2] for run in runs]
        np.testing.assert_array_equal(thetas[0], thetas[1])
        np.testing.assert_array_equal(thetas[0], thetas[2])
        assert costs[0] == costs[1] == costs[2]
        settings = [run.study.settings | {"search": None} for run in runs]
        assert settings[0] == settings[1] == settings[2]


def test_paper_tables_hold_what_the_runs_hold(smoke):
    folder, words = smoke
    with (folder / "results" / "paper" / "table.csv").open() as text:
        rows = list(csv.DictReader(text))
    searches = ("paper", "bayesian", "sobol")
    assert [(row["scenario"], row["search"]) for row in rows] == [
        (n, s) for n in ("origin", "circle") for s in searches
    ]
    for row in rows:
        result = Result.open(folder / f"{row['scenario']}-{row['search']}-3")
        assert result.complete
        assert float(row["best_J"]) == pytest.approx(result.best.J, rel=1e-3)
        assert int(row["best_at"]) == result.best.number
        assert 1 <= int(row["near_at"]) <= int(row["best_at"]) <= int(row["trials"]) == 3
        assert float(row["plant_s"]) == 3 * 6.0
        flown = [f.score.J for f in result.flights().values() if np.array_equal(f.theta, result.best.theta)]
        assert float(row["verified_J"]) == pytest.approx(flown[0], rel=1e-3)
        assert all(value in words for value in row.values())
    assert "evaluation 42" in words


@pytest.mark.slow
def test_what_is_tuned_where_nothing_pushes_pays_for_it_where_something_does(tmp_path):
    """Each row of the table: J undisturbed, of a softer arm, pushed, and of a softer one that is pushed."""
    command = [sys.executable, str(STUDIES / "probed_arm.py")]
    done = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path, timeout=300)
    assert done.returncode == 0, done.stderr
    rows = [line.split() for line in done.stdout.splitlines()[-4:]]
    J = {name: np.array(costs, dtype=float) for name, *costs in rows}
    assert list(J) == ["untuned", "tuned", "tuned-doubting", "tuned-pushed"]
    assert J["tuned"][0] < J["tuned-doubting"][0] < 0.97 * J["untuned"][0]
    assert np.all(2 * J["untuned"][1:] < J["tuned"][1:])
    for name in ("tuned-doubting", "tuned-pushed"):
        assert np.all(J[name] < 1.5 * J["untuned"])
