"""What `socasadi show` draws of the costs."""

import numpy as np
import pytest

from socasadi._sparkline import sparkline
from socasadi.campaign import Trial

BLOCKS = "▁▂▃▄▅▆▇█"


def trials(*costs):
    """Trials by number: a cost, or the outcome of one without."""
    asked = {"phase": "search", "theta": np.zeros(2), "give_up": None, "started": "", "by_hand": False, "seconds": {}}
    outcomes = [{"outcome": "done", "J": cost} if isinstance(cost, float) else {"outcome": cost} for cost in costs]
    return [Trial(number=n, asked=n, told=n, **asked, **outcome) for n, outcome in enumerate(outcomes, 1)]


def drawn(*costs, kept=lambda trial: trial.J is not None, width=120, encoding="utf-8"):
    return sparkline(trials(*costs), kept, width, encoding)


def test_equal_ratios_of_cost_are_equal_steps_from_the_best_at_the_least_block():
    legend, line, pointer = drawn(*(1.5 * 1.3**k for k in range(8)))
    assert line == BLOCKS
    assert legend == "J over the trials: ▁ 1.5 to █ 9.412 (log scale)"
    assert pointer == "^ best: trial 1"


def test_trials_that_failed_or_were_cut_or_broke_a_limit_are_signs_of_their_own_that_are_counted():
    legend, line, pointer = drawn(
        8.0, "failed", 1.0, "cut", 2.0, "failed", kept=lambda trial: trial.J is not None and trial.J > 1
    )
    assert line == "█x!>▁x"
    assert legend.endswith(", ! broke a limit (1), > cut (1), x failed (2)")
    assert pointer == "    ^ best: trial 5"


def test_trials_stand_by_number_whatever_the_order_of_telling():
    told = trials(3.0, 1.0, 2.0)
    for lines in (sparkline(list(order), lambda _: True, 120, "utf-8") for order in (told, told[::-1])):
        assert lines[1] == "█▁▆"


def test_a_cost_far_off_does_not_squeeze_the_others():
    legend, line, _ = drawn(1.0, 2.0, 30.0, 1e9)
    assert line == "▁▂██"
    assert "█ 30 and above" in legend


@pytest.mark.parametrize(("count", "width", "columns"), [(5, 80, 5), (110, 120, 110), (110, 80, 55), (1000, 500, 112)])
def test_many_trials_share_columns_that_show_the_best_of_theirs(count, width, columns):
    costs = [2.0 + n for n in range(count)]
    costs[count // 2] = 1.0
    legend, line, pointer = drawn(*costs, width=width)
    assert len(line) == columns
    assert line.index("▁") == pointer.index("^") == count // 2 // -(-count // columns)
    assert ("the best" in legend) == (columns < count)
    assert len(pointer) <= max(columns, len(f"^ best: trial {count}") + columns // 2 + 1)
    assert f"best: trial {count // 2 + 1}" in pointer


def test_a_failure_does_not_hide_the_cost_beside_it():
    _, line, _ = drawn("failed", 1.0, "cut", "failed", 4.0, "cut", "failed", "failed", width=4)
    assert line == "▁>█x"


def test_where_the_best_is_last_its_name_is_to_the_left():
    *_, pointer = drawn(*(float(100 - n) for n in range(40)))
    assert pointer == f"{'best: trial 40 ^':>40}"


def test_without_a_success_there_is_no_scale_and_without_a_trial_nothing():
    assert drawn("failed", "failed", "cut") == ["J over the trials: > cut (1), x failed (2)", "xx>"]
    assert drawn() == []


def test_one_cost_and_costs_that_are_not_above_zero_are_drawn():
    assert drawn(3.0)[:2] == ["J over the trials: ▁ 3", "▁"]
    legend, line, _ = drawn(-1.0, 0.0, 6.0)
    assert line == "▁▂█"
    assert "linear scale" in legend


def test_where_there_are_no_blocks_it_is_ascii():
    for lines in (drawn(1.0, 30.0, "failed", encoding=encoding) for encoding in ("ascii", "cp1252", "no such")):
        assert lines[1] == ".#x"
        assert "".join(lines).isascii()
