"""What figures of a comparison show, and that what is committed is what the script and its cells say."""

import csv
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from comparison_support import Better, Good, comparison

from socasadi.baselines import Summary, fitting_cells, fly_cell, load_comparison, summary_table
from socasadi.report import comparison_figures

STUDIES = Path(__file__).parents[2] / "studies"


def test_a_figure_says_how_much_was_flown_and_how_much_that_is_of():
    full = comparison(seeds=tuple(range(10)), checkpoints=(1, 2, 3, 110), flights=1)
    flown = full.of_size("quick").of_parts(methods=["better"], seeds=1)
    summary = Summary.of([fly_cell(flown, "circle", "better", 0)], ["circle"], ["better"])
    for figure in comparison_figures(summary, full, "quick").values():
        assert figure.get_suptitle() == (
            "quick: 1 method, 1 task, 1 seed, 1 flight each, 3 episodes' worth of the robot's time\n"
            "The whole comparison: 3 methods, 1 task, 10 seeds, 1 flight each, 110 episodes' worth of the robot's time"
        )


def test_figures_pick_out_what_the_script_says_and_mark_nothing_above_their_scale():
    """More than three times the least J is a line along the edge."""
    made = comparison(methods={"good": Good(), "better": Better()}, checkpoints=(1, 2, 3), flights=1)
    cells = [fly_cell(made, *names) for names in made.cells]
    cells[1]["points"][0]["J"] = [99.0]
    for shown, named in ((("better",), ["better", "others"]), ((), ["good", "better"])):
        figures = comparison_figures(
            Summary.of(cells, ["circle"], ["good", "better"]), replace(made, shown=shown), "full"
        )
        assert [text.get_text() for text in figures["cost"].legends[0].get_texts()] == named
        (place,) = (axes for axes in figures["cost"].axes if axes.get_visible())
        top = place.get_ylim()[1]
        lines = [line for line in place.lines if line.get_marker() != ""]
        assert len(lines) == len(shown or named)
        for line in lines:
            marked = line.get_ydata()[line.get_markevery()]
            assert (marked < top).all()
            assert len(marked) == np.sum(line.get_ydata() < top)
    assert any(line.get_ydata()[0] == top for line in place.lines)


def test_a_method_that_is_far_better_than_the_first_is_in_the_picture():
    made = comparison(methods={"good": Good(), "better": Better()}, checkpoints=(1,), flights=1)
    cells = [fly_cell(made, *names) for names in made.cells]
    for cell, J in zip(cells, (1.0, 0.2), strict=True):
        cell["points"][-1]["J"] = [J]
    drawn = comparison_figures(Summary.of(cells, ["circle"], ["good", "better"]), made, "full")["methods"]
    (place,) = (axes for axes in drawn.axes if axes.get_visible())
    assert place.get_xlim()[0] < 0.2


def test_distances_are_from_the_reference_and_averaged_over_a_second():
    made = comparison(methods={"good": Good()}, checkpoints=(1,), flights=1)
    cell = fly_cell(made, "circle", "good", 0)
    figures = comparison_figures(Summary.of([cell], ["circle"], ["good"]), made, "full")
    (line,) = figures["distances"].axes[0].lines
    path, time = 1e3 * np.array(cell["path"]), 0.05 * np.arange(121)
    error = path - 30 * np.stack([np.cos(2 * np.pi * time / 6), np.sin(2 * np.pi * time / 6)], axis=1)
    seen = np.array(line.get_ydata())
    for k in (15, 60, 100):
        around = error[k - 10 : k + 10]
        assert seen[k] == pytest.approx(np.sqrt(np.mean(np.sum(around**2, axis=1))), rel=1e-6)
    np.testing.assert_allclose(line.get_xdata(), time)
    # A flight that broke off early is drawn as far as it went.
    for rows in (1, 7, 30):
        broken = cell | {"path": cell["path"][:rows]}
        figures = comparison_figures(Summary.of([broken], ["circle"], ["good"]), made, "full")
        (line,) = figures["distances"].axes[0].lines
        assert len(line.get_ydata()) == rows
        assert np.isfinite(line.get_ydata()).all()
    last = np.sqrt(np.mean(np.sum(error[19:30] ** 2, axis=1)))
    assert line.get_ydata()[-1] == pytest.approx(last, rel=1e-6)


def test_the_committed_table_is_that_of_the_committed_cells_of_the_script_as_it_is():
    made, folder = load_comparison(STUDIES / "compare.py"), STUDIES / "results" / "compare"
    cells = fitting_cells(made, folder)
    assert sorted((cell["task"], cell["method"], cell["seed"]) for cell in cells) == sorted(made.cells)
    rows = summary_table(Summary.of(cells, list(made.tasks), list(made.methods)))
    with (folder / "table.csv").open() as file:
        assert [row | {"size": "full"} for row in rows] == list(csv.DictReader(file))
