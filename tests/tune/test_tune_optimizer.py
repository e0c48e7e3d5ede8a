"""The ask/tell search: better than Sobol, the same after a replay, unharmed by failures."""

import json
import subprocess
import sys

import numpy as np
import pytest

from socasadi.tune import Optimizer, Parameter, SobolSearch, Space

BRANIN = Space([Parameter("x", "", -5, 10), Parameter("y", "", 0, 15)])
BRANIN_MINIMUM = 0.397887  # Dixon and Szego 1978


def branin(theta):
    x, y = theta
    curve = y - 5.1 / (4 * np.pi**2) * x**2 + 5 / np.pi * x - 6
    return float(curve**2 + 10 * (1 - 1 / (8 * np.pi)) * np.cos(x) + 10)


def cube(d):
    return Space([Parameter(f"x{i}", "", 0.0, 1.0) for i in range(d)])


def sphere(theta):
    return 0.1 + float(np.sum((theta - 0.3) ** 2))


def run(search, cost, trials, fails=lambda theta: False):
    for _ in range(trials):
        theta = search.ask()
        if fails(theta):
            search.tell(theta, failed=True)
        else:
            search.tell(theta, cost(theta))
    return search


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_branin_is_solved_in_30_trials_and_sobol_is_far(seed):
    found = run(Optimizer(BRANIN, seed=seed, seed_points=6), branin, 30).best.cost
    sobol = run(SobolSearch(BRANIN, seed=seed), branin, 30).best.cost
    assert found - BRANIN_MINIMUM < 0.01
    assert found < sobol


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_sphere_in_six_dimensions_beats_sobol_at_equal_budget(seed):
    space = cube(6)
    found = run(Optimizer(space, seed=seed, seed_points=8), sphere, 24).best.cost
    sobol = run(SobolSearch(space, seed=seed), sphere, 24).best.cost
    assert found - 0.1 < 0.2 * (sobol - 0.1)


@pytest.mark.parametrize("seed", [0, 1])
def test_the_papers_settings_beat_sobol_on_branin(seed):
    found = run(Optimizer.paper(BRANIN, seed=seed, seed_points=6), branin, 30).best.cost
    assert found < run(SobolSearch(BRANIN, seed=seed), branin, 30).best.cost


def test_the_papers_settings_are_the_papers():
    search = run(Optimizer.paper(BRANIN, seed=0, seed_points=6), branin, 8)
    hyper = search.hyperparameters
    assert hyper["mean"] == 0.0
    assert hyper["noise"] == pytest.approx(1e-4)
    assert set(hyper) == {"mean", "variance", "noise", "lengthscale:x", "lengthscale:y"}


def test_seed_points_are_those_of_the_sobol_search_and_initial_points_come_first():
    first = [[1.0, 2.0], [3.0, 4.0]]
    search, sobol = Optimizer(BRANIN, seed=5, seed_points=6, initial=first), SobolSearch(BRANIN, seed=5)
    asked = []
    for _ in range(6):
        asked.append(search.ask())
        search.tell(asked[-1], branin(asked[-1]))
        sobol.tell(sobol.ask(), 1.0)
    np.testing.assert_array_equal(asked[:2], first)
    np.testing.assert_array_equal(asked[2:], [trial.theta for trial in sobol.trials[:4]])


def test_sobol_fills_the_box_and_grows_without_changing_what_it_gave():
    search = run(SobolSearch(cube(3), seed=1), sphere, 64)
    points = np.array([trial.theta for trial in search.trials])
    # A (t, m, s)-net in base 2: each coordinate has one point in each of 64 equal intervals.
    for column in points.T:
        np.testing.assert_array_equal(np.sort(np.floor(64 * column)), np.arange(64))
    again = SobolSearch(cube(3), seed=1)
    np.testing.assert_array_equal(again.ask(), points[0])
    assert not np.array_equal(SobolSearch(cube(3), seed=2).ask(), points[0])


@pytest.mark.parametrize("paper", [False, True])
def test_a_replayed_search_asks_the_very_same_points(paper):
    def new():
        return Optimizer.paper(cube(3), 4, seed_points=4) if paper else Optimizer(cube(3), seed=4, seed_points=4)

    whole = run(new(), sphere, 14, fails=lambda theta: theta[0] > 0.8)
    for count in (0, 3, 4, 9, 13):
        resumed = new()
        for trial in whole.trials[:count]:
            resumed.tell(trial.theta, trial.cost, failed=trial.failed)
        np.testing.assert_array_equal(resumed.ask(), whole.trials[count].theta)
        np.testing.assert_array_equal(resumed.ask(), whole.trials[count].theta)


def test_looking_at_the_model_does_not_change_what_is_asked():
    quiet = run(Optimizer(BRANIN, seed=2, seed_points=5), branin, 9)
    nosy = Optimizer(BRANIN, seed=2, seed_points=5)
    for trial in quiet.trials:
        nosy.ask()
        nosy.tell(trial.theta, trial.cost)
        nosy.predict([0.0, 5.0])
    np.testing.assert_array_equal(nosy.ask(), quiet.ask())


def test_a_new_process_asks_the_very_same_point():
    search = run(Optimizer(BRANIN, seed=3, seed_points=5), branin, 12)
    told = [[trial.theta.tolist(), trial.cost] for trial in search.trials]
    code = """
import json, sys
from socasadi.tune import Optimizer, Parameter, Space
search = Optimizer(Space([Parameter("x", "", -5, 10), Parameter("y", "", 0, 15)]), seed=3, seed_points=5)
for theta, cost in json.load(sys.stdin):
    search.tell(theta, cost)
print(json.dumps(search.ask().tolist()))
"""
    done = subprocess.run(
        [sys.executable, "-c", code], input=json.dumps(told), capture_output=True, text=True, check=True
    )
    assert json.loads(done.stdout) == search.ask().tolist()


def test_the_seed_and_every_told_cost_matter():
    first = run(Optimizer(BRANIN, seed=0, seed_points=5), branin, 8)
    other = Optimizer(BRANIN, seed=1, seed_points=5)
    changed = Optimizer(BRANIN, seed=0, seed_points=5)
    assert not np.array_equal(first.trials[0].theta, other.ask())
    for trial in first.trials:
        changed.tell(trial.theta, trial.cost * (2 if trial is first.best else 1))
    assert not np.array_equal(first.ask(), changed.ask())


def test_units_do_not_matter():
    # Powers of two scale without rounding, so the very same points are asked.
    small, large = cube(2), Space([Parameter(f"x{i}", "", 0.0, 2.0**30) for i in range(2)])
    a = run(Optimizer(small, seed=1, seed_points=5), sphere, 9)
    b = run(Optimizer(large, seed=1, seed_points=5), lambda theta: sphere(theta / 2.0**30), 9)
    np.testing.assert_array_equal(2.0**30 * a.ask(), b.ask())


def test_no_point_is_asked_twice_even_when_the_minimum_is_found():
    space = cube(1)
    search = run(Optimizer(space, seed=0, seed_points=4), sphere, 25)
    points = np.sort([trial.theta[0] for trial in search.trials])
    assert np.diff(points).min() > 1e-4
    assert search.best.cost == pytest.approx(0.1, abs=1e-6)


def test_failures_steer_the_search_away_and_are_never_the_best():
    space = cube(3)

    def fails(theta):
        return theta[0] > 0.4

    search = run(Optimizer(space, seed=0, seed_points=8), sphere, 28, fails)
    asked = search.trials[8:]
    assert sum(trial.failed for trial in asked) <= 6  # 12 of 20 points at random
    assert not search.best.failed
    assert search.best.cost < 0.105


def test_while_all_trials_fail_it_keeps_exploring():
    space = cube(2)
    search = run(Optimizer(space, seed=0, seed_points=4), sphere, 12, fails=lambda theta: True)
    sobol = run(SobolSearch(space, seed=0), sphere, 12)
    assert search.best is None
    np.testing.assert_array_equal([trial.theta for trial in search.trials], [trial.theta for trial in sobol.trials])
    search.tell([0.3, 0.3], 0.1)
    asked = search.ask()
    assert np.abs([trial.theta - asked for trial in search.trials]).max(axis=1).min() > 1e-4
    assert search.best.cost == 0.1


def test_constant_costs_do_not_break_it():
    search = run(Optimizer(cube(2), seed=0, seed_points=4), lambda theta: 5.0, 10)
    points = np.array([trial.theta for trial in search.trials])
    assert np.all(np.isfinite(points))
    assert len(np.unique(np.round(points, 4), axis=0)) == 10


def test_costs_over_forty_decades_do_not_break_the_log_model():
    search = run(Optimizer(cube(2), seed=0, seed_points=5), lambda t: float(np.exp(150 * sphere(t))), 15)
    assert np.log(search.best.cost) / 150 < 0.12


def test_prediction_is_on_the_logarithm_of_the_cost():
    search = run(Optimizer(cube(2), seed=0, seed_points=8), sphere, 16)
    mean, std = search.predict([0.3, 0.35])
    assert mean == pytest.approx(np.log(0.1025), abs=0.05)
    assert 0 < std < 0.1
    with pytest.raises(ValueError, match="nothing can be predicted"):
        Optimizer(cube(2)).predict([0.5, 0.5])


def test_timings_are_those_of_the_last_ask():
    search = run(Optimizer(cube(2), seed=0, seed_points=3), sphere, 3)
    assert (search.timings.fit, search.timings.acquisition) == (0.0, 0.0)
    search.ask()
    assert search.timings.fit > 0
    assert search.timings.acquisition > 0


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ({"kernel": "linear"}, "unknown kernel 'linear'; known are 'matern52', 'rbf'"),
        ({"acquisition": "ucb"}, "unknown acquisition 'ucb'; known are 'log_ei', 'ei'"),
        ({"transform": "sqrt"}, "unknown transform 'sqrt'; known are 'log-half-rank', 'log', 'none'"),
        ({"mean": None}, "unknown mean None; known are 'constant', 'zero'"),
        ({"noise": -1.0}, "noise is -1.0"),
        ({"seed": -1}, "seed is -1"),
        ({"seed": 1.5}, "seed is 1.5"),
        ({"seed_points": 0}, "seed_points is 0"),
        ({"initial": [[0.5, 2.0]]}, r"theta\[1\] \(x1\) is 2.0, outside its bounds"),
    ],
)
def test_a_setting_that_makes_no_sense_is_refused(settings, said):
    with pytest.raises(ValueError, match=said):
        Optimizer(cube(2), **settings)


@pytest.mark.parametrize("search", [Optimizer(cube(2)), SobolSearch(cube(2))])
@pytest.mark.parametrize(
    ("told", "said"),
    [
        ({"theta": [0.5], "cost": 1.0}, r"shape \(1,\)"),
        ({"theta": [0.5, 1.5], "cost": 1.0}, r"theta\[1\] \(x1\) is 1.5"),
        ({"theta": [0.5, 0.5], "cost": np.nan}, "the cost is nan: tell failed=True"),
        ({"theta": [0.5, 0.5], "cost": np.inf}, "the cost is inf: tell failed=True"),
        ({"theta": [0.5, 0.5], "cost": "low"}, "the cost must be a number, not 'low'"),
        ({"theta": [0.5, 0.5], "cost": 1.0, "failed": True}, "failed trial was told with the cost 1.0"),
        ({"theta": [0.5, 0.5]}, "without a cost"),
    ],
)
def test_a_telling_that_makes_no_sense_is_refused_and_not_recorded(search, told, said):
    with pytest.raises(ValueError, match=said):
        search.tell(**told)
    assert search.trials == ()


def test_a_cost_that_has_no_logarithm_is_refused():
    search = Optimizer(cube(1))
    with pytest.raises(ValueError, match=r'the cost is 0\.0 and log J is modelled: use transform="none"'):
        search.tell([0.5], 0.0)
    assert search.trials == ()
    Optimizer(cube(1), transform="none").tell([0.5], -3.0)
    with pytest.raises(ValueError, match="too large"):
        Optimizer(cube(1), transform="none").tell([0.5], 1e200)
