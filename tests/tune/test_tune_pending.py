"""Several experiments at the same time: distinct points, a pure function of what was asked and told, little waste."""

import json
import subprocess
import sys

import numpy as np
import pytest
from tune_support import BRANIN, BRANIN_MINIMUM, branin, cube, nearest, repeats, run, sphere, told

from socasadi.tune import Optimizer, SobolSearch


def test_points_asked_at_once_are_distinct_and_spread():
    search = run(Optimizer(BRANIN, seed=0, seed_points=6), branin, 8)
    batch = []
    for _ in range(4):
        batch.append(search.ask(batch))
    units = np.array([search.space.to_unit(theta) for theta in [*told(search), *batch]])
    assert nearest(units[8:]) > 0.02
    assert repeats(units, 1e-4) == 0


def test_a_batch_is_asked_one_after_the_other():
    search = run(Optimizer(BRANIN, seed=0, seed_points=6), branin, 8)
    first = [5.0, 5.0]
    expected = [search.ask([first])]
    expected.append(search.ask([first, expected[0]]))
    np.testing.assert_array_equal(search.ask_batch(2, [first]), expected)
    with pytest.raises(ValueError, match="count is 0"):
        search.ask_batch(0)


def test_a_batch_before_the_first_fit_is_the_space_filling_sequence():
    search, sobol = Optimizer(BRANIN, seed=3, seed_points=6), SobolSearch(BRANIN, seed=3)
    batch, expected = [], []
    for _ in range(6):
        batch.append(search.ask(batch))
        expected.append(sobol.ask(expected))
    np.testing.assert_array_equal(batch, expected)
    assert repeats(np.array(batch)) == 0


def test_start_points_are_handed_out_once_each_to_those_who_ask_at_once():
    first = np.random.default_rng(0).random((3, 2))
    search = Optimizer(cube(2), seed=0, initial=first)
    batch = []
    for _ in range(4):
        batch.append(search.ask(batch))
    np.testing.assert_array_equal(batch[:3], first)
    assert np.abs(batch[3] - first).max(axis=1).min() > 1e-3


def outcome(theta):
    return {"failed": True} if theta[0] > 0.85 else {"cost": sphere(theta)}


def asynchronous(new, count, seed):
    """Experiments that end in any order: the events, and what was asked when.

    An event is the ask, or the place in the list of pending ones of the one that is told.
    """
    rng, search, pending, events = np.random.default_rng(seed), new(), [], []
    asked = 0
    while asked < count:
        if len(pending) < 4 and (not pending or rng.random() < 0.6):
            theta = search.ask(pending)
            pending.append(theta)
            events.append(("ask", theta.tolist()))
            asked += 1
        else:
            place = int(rng.integers(len(pending)))
            theta = pending.pop(place)
            search.tell(theta, **outcome(theta))
            events.append(("tell", place))
    return events


@pytest.mark.parametrize("acquisition", ["log_ei", "noisy_ei"])
def test_what_is_asked_follows_from_the_order_of_asks_and_tells(acquisition):
    def new():
        return Optimizer(cube(2), seed=2, seed_points=4, acquisition=acquisition)

    events = asynchronous(new, 12, 0)
    assert sum(kind == "tell" for kind, _ in events) >= 6
    # One who was there all the time, without asking; it asks only at the end of each stretch of the record.
    stops = [i for i, (kind, _) in enumerate(events) if kind == "ask"][5::3]
    for stop in stops:
        search, pending = new(), []
        for kind, value in events[:stop]:
            if kind == "ask":
                pending.append(np.array(value))
            else:
                theta = pending.pop(value)
                search.tell(theta, **outcome(theta))
        assert search.ask(pending).tolist() == events[stop][1]


def test_a_new_process_goes_on_with_the_very_same_points():
    events = asynchronous(lambda: Optimizer(cube(2), seed=2, seed_points=4), 9, 1)
    stop = max(i for i, (kind, _) in enumerate(events) if kind == "ask")
    told, pending = [], []
    for kind, value in events[:stop]:
        if kind == "ask":
            pending.append(value)
        else:
            theta = pending.pop(value)
            told.append([theta, outcome(theta)])
    code = """
import json, sys
from socasadi.tune import Optimizer, Parameter, Space
told, pending = json.load(sys.stdin)
search = Optimizer(Space([Parameter(f"x{i}", "", 0.0, 1.0) for i in range(2)]), seed=2, seed_points=4)
for theta, outcome in told:
    search.tell(theta, **outcome)
print(json.dumps(search.ask(pending).tolist()))
"""
    done = subprocess.run(
        [sys.executable, "-c", code], input=json.dumps([told, pending]), capture_output=True, text=True, check=True
    )
    assert json.loads(done.stdout) == events[stop][1]


def test_pending_points_are_checked_as_told_ones_are():
    search = run(Optimizer(cube(2), seed=0, seed_points=3), sphere, 4)
    with pytest.raises(ValueError, match=r"theta\[1\] \(x1\) is 1.5"):
        search.ask([[0.5, 1.5]])
    with pytest.raises(ValueError, match="is nan"):
        search.ask([[0.5, np.nan]])


def test_what_is_pending_while_there_are_only_failures_goes_on_through_the_box():
    search = Optimizer(cube(2), seed=0, seed_points=2)
    run(search, sphere, 3, fails=lambda theta: True)
    batch = []
    for _ in range(4):
        batch.append(search.ask(batch))
    assert nearest(np.vstack([told(search), batch])) > 1e-3


def needed(seed, q, regret=0.2, most=48):
    """Evaluations until Branin's minimum is found, q at a time."""
    search = Optimizer(BRANIN, seed=seed, seed_points=6)
    while len(search.trials) < most:
        batch = []
        for _ in range(q):
            batch.append(search.ask(batch))
        for theta in batch:
            search.tell(theta, branin(theta))
        if search.best.cost < BRANIN_MINIMUM + regret:
            break
    return len(search.trials)


@pytest.mark.slow
def test_four_at_a_time_need_no_more_than_twice_the_evaluations():
    assert needed(0, 4) <= 2 * needed(0, 1)


@pytest.mark.slow
def test_four_at_a_time_need_no_more_than_half_as_many_again_in_the_median():
    seeds = range(2, 12)
    four, one = (np.median([needed(seed, q) for seed in seeds]) for q in (4, 1))
    assert four <= 1.5 * one


@pytest.mark.parametrize("size", [4, pytest.param(8, marks=pytest.mark.slow)])
def test_batches_meet_processes_of_every_kind(size):
    """Points that are asked at once see one and the same process; it must not be of one kind in every batch."""
    search = Optimizer(cube(2), seed=0, seed_points=size)
    sums = []
    for _ in range(8):
        for theta in search.ask_batch(size):
            search.tell(theta, sphere(theta))
        sums.append(search.hyperparameters.get("additive", 0.0) > 0)
    assert 1 <= sum(sums) <= 5
