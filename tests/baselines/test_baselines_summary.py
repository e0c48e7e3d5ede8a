"""What is said of many cells: quartiles, tables, and whether one method is better than another."""

import numpy as np
import pytest

from socasadi.baselines import Summary, summary_table


def made_up(costs):
    """Cells of two methods, costs by method as (tasks, seeds)."""
    point = {"rmse": [1e-3], "settled": 1e-3, "violated": 0.0, "effort": 0.1, "spent": 20.0}
    return [
        {
            "task": f"task {i}",
            "method": method,
            "seed": seed,
            "information": "data sheet",
            "checkpoints": [30],
            "points": [
                point | {"J": [None if np.isinf(J) else J], "solve": [1e-6 * (10 * k + seed) for k in (1, 2, 3)]}
            ],
            "elsewhere": {},
            "open_loop": None,
            "flights": 30,
            "failed": 1,
            "broke": "Error: it does not add up" if seed == 1 else None,
        }
        for method, rows in costs.items()
        for i, row in enumerate(rows)
        for seed, J in enumerate(row)
    ]


def rivalry(ours, theirs, **others):
    tasks = [f"task {i}" for i in range(len(ours))]
    costs = {"ours": ours, "theirs": theirs} | others
    return Summary.of(made_up(costs), tasks, list(costs)).rivalries()["theirs"]


def test_a_rival_is_beaten_task_by_task_and_seed_by_seed():
    theirs = np.exp(np.random.default_rng(0).standard_normal((3, 8)))
    lower = theirs * np.linspace(0.8, 0.95, 8)
    told = rivalry(lower, theirs)
    assert (told.won, told.tasks) == (3, 3)
    assert told.excess[1] == pytest.approx(np.exp(np.median(-np.log(np.linspace(0.8, 0.95, 8)))) - 1)
    # Tasks of one seed are no experiments of their own: eight differences of one sign, not twenty-four.
    assert told.p == pytest.approx(2 * 0.5**8)
    assert rivalry(theirs, theirs[:, ::-1]).p > 0.05
    assert np.isnan(rivalry(lower[:, :5], theirs[:, :5]).p)


def test_that_many_rivals_were_tested_is_reckoned_with():
    theirs = np.exp(np.random.default_rng(0).standard_normal((1, 8)))
    lower = theirs * np.linspace(0.8, 0.95, 8)
    assert rivalry(lower, theirs, third=theirs, fourth=theirs[:, ::-1]).p == pytest.approx(3 * 2 * 0.5**8)


def test_only_seeds_that_both_have_flown_are_compared_and_a_failure_is_far_behind():
    cells = made_up({"ours": [[1.0, 2.0, 4.0]], "theirs": [[1.1, 2.2, np.inf]]})
    mixed = [cell for cell in cells if (cell["method"], cell["seed"]) != ("ours", 0)]
    told = Summary.of(mixed, ["task 0"], ["ours", "theirs"]).rivalries()["theirs"]
    assert told.won == 1
    assert told.excess[0] > 1e5  # the quartile of 10 % and of a failure
    both = Summary.of(cells, ["task 0"], ["ours", "theirs"]).rivalries()["theirs"]
    assert both.excess[1] == pytest.approx(0.1)


def test_methods_that_share_no_seed_on_all_tasks_are_not_compared_over_them():
    """The first task is flown with seed 0, the second with seed 1."""
    flown = [
        c for c in made_up({"ours": np.ones((2, 2)), "theirs": np.ones((2, 2))}) if c["task"][-1] == str(c["seed"])
    ]
    told = Summary.of(flown, ["task 0", "task 1"], ["ours", "theirs"]).rivalries()["theirs"]
    assert (told.won, told.tasks) == (2, 2)
    assert np.isnan([*told.excess, told.p]).all()


def test_quartiles_over_ten_seeds_are_those_of_numpy_and_failures_are_infinite():
    costs = [list(range(1, 11)), [1.0] * 4 + [np.inf] * 6]
    summary = Summary.of(made_up({"ours": costs}), ["task 0", "task 1"], ["ours"])
    np.testing.assert_allclose(summary.over_time("task 0", "ours")[0], [3.25, 5.5, 7.75])
    assert summary.over_time("task 1", "ours")[0].tolist() == [1.0, np.inf, np.inf]


def test_of_cells_that_were_flown_twice_the_last_counts():
    cells = made_up({"ours": [[3.0]]}) + made_up({"ours": [[2.0]]})
    assert Summary.of(cells, ["task 0"], ["ours"]).values("task 0", "ours", "J").tolist() == [2.0]


def test_the_table_has_a_row_for_each_task_and_method():
    summary = Summary.of(made_up({"ours": [[2.0, 4.0, np.inf]]}), ["task 0"], ["ours", "absent"])
    (row,) = summary_table(summary)
    assert (row["J"], row["RMSE / mm"], row["open loop / mm"]) == ("4", "1", "-")
    assert (row["failed"], row["while tuned"], row["seeds"], row["broke"]) == ("1 of 3", "3 of 90", "3", "1 of 3")
    assert (row["step p50 / us"], row["p99 / us"], row["max / us"]) == ("11", "21", "32")


def test_a_seed_on_which_neither_has_a_controller_for_one_task_counts_with_the_others():
    """The rival always has half the J, where there is any."""
    ours = np.exp(np.random.default_rng(0).standard_normal((3, 8)))
    ours[np.arange(8) % 3, np.arange(8)] = np.inf
    cells = made_up({"ours": ours, "theirs": 0.5 * ours})
    told = Summary.of(cells, [f"task {i}" for i in range(3)], ["ours", "theirs"]).rivalries()["theirs"]
    assert (told.won, told.tasks) == (0, 3)
    assert told.excess == pytest.approx((-0.5, -0.5, -0.5))
    assert told.p == pytest.approx(2 / 2**8)
