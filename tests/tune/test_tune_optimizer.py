"""The ask/tell search: better than Sobol, the same after a replay, unharmed by failures."""

import json
import subprocess
import sys

import numpy as np
import pytest
from tune_support import BRANIN, BRANIN_MINIMUM, branin, cube, repeats, run, sphere, told

from socasadi.tune import Optimizer, SobolSearch
from socasadi.tune._belief import last_full_fit


def branin_in_30_trials(seeds):
    """The best of the search and of Sobol points, by seed; the function spans 300."""
    found = [run(Optimizer(BRANIN, seed=seed, seed_points=6), branin, 30).best.cost for seed in seeds]
    return np.array(found), [run(SobolSearch(BRANIN, seed=seed), branin, 30).best.cost for seed in seeds]


def test_branin_is_nearly_solved_in_30_trials_and_sobol_is_far():
    found, sobol = branin_in_30_trials([0])
    assert found - BRANIN_MINIMUM < 0.05
    assert found < sobol


@pytest.mark.slow
def test_branin_is_solved_in_the_median_of_three_seeds():
    found, sobol = branin_in_30_trials(range(3))
    assert np.median(found) - BRANIN_MINIMUM < 0.01
    assert max(found) - BRANIN_MINIMUM < 0.05
    assert np.all(found < sobol)


def test_sphere_in_six_dimensions_beats_sobol_at_equal_budget():
    space = cube(6)
    found = run(Optimizer(space, seed=0, seed_points=8), sphere, 20).best.cost
    sobol = run(SobolSearch(space, seed=0), sphere, 20).best.cost
    assert found - 0.1 < 0.2 * (sobol - 0.1)


def test_the_papers_settings_beat_sobol_on_branin():
    found = run(Optimizer.paper(BRANIN, seed=0, seed_points=6), branin, 16).best.cost
    assert found < run(SobolSearch(BRANIN, seed=0), branin, 16).best.cost


@pytest.mark.parametrize("acquisition", ["ei", "noisy_ei", "ucb"])
def test_every_acquisition_beats_sobol(acquisition):
    found = run(Optimizer(cube(2), seed=0, seed_points=5, acquisition=acquisition), sphere, 12).best.cost
    sobol = run(SobolSearch(cube(2), seed=0), sphere, 12).best.cost
    assert found - 0.1 < 0.2 * (sobol - 0.1)


@pytest.mark.parametrize(
    "settings",
    [{"warp": True, "transform": "none"}, {"kernel": "rbf", "transform": "box-cox"}, {"priors": False, "noise": 1e-5}],
)
def test_every_setting_beats_sobol(settings):
    found = run(Optimizer(cube(2), seed=0, seed_points=6, **settings), sphere, 11).best.cost
    sobol = run(SobolSearch(cube(2), seed=0), sphere, 11).best.cost
    assert found - 0.1 < 0.5 * (sobol - 0.1)


def test_costs_of_either_sign_are_searched_by_default():
    found = run(Optimizer(cube(2), seed=0, seed_points=5), lambda theta: sphere(theta) - 3.0, 11).best.cost
    assert found == pytest.approx(-2.9, abs=5e-3)


def test_the_papers_settings_are_the_papers():
    search = run(Optimizer.paper(BRANIN, seed=0, seed_points=6), branin, 8)
    hyper = search.hyperparameters
    assert hyper["mean"] == 0.0
    assert hyper["noise"] == pytest.approx(1e-4)
    assert hyper["additive"] == 0.0
    assert set(hyper) == {"mean", "variance", "additive", "noise", "lengthscale:x", "lengthscale:y"}


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


NEW = {
    "default": lambda space: Optimizer(space, seed=4, seed_points=4),
    "paper": lambda space: Optimizer.paper(space, 4, seed_points=4),
    "noisy_ei": lambda space: Optimizer(space, seed=4, seed_points=4, acquisition="noisy_ei"),
}


@pytest.mark.parametrize("kind", NEW)
def test_a_replayed_search_asks_the_very_same_points(kind):
    def new():
        return NEW[kind](cube(3))

    whole = run(new(), sphere, 9, fails=lambda theta: theta[0] > 0.8)
    for count in (0, 3, 4, 6, 8):
        resumed = new()
        for trial in whole.trials[:count]:
            resumed.tell(trial.theta.tolist(), trial.cost and float(repr(trial.cost)), failed=trial.failed)
        np.testing.assert_array_equal(resumed.ask(), whole.trials[count].theta)
        np.testing.assert_array_equal(resumed.ask(), whole.trials[count].theta)


def test_a_replay_does_not_depend_on_whether_equal_numbers_are_one_object():
    # A deterministic cost that is told twice at one place, live and from a file.
    live, filed = Optimizer(cube(1), seed=0, seed_points=3), Optimizer(cube(1), seed=0, seed_points=3)
    value = sphere([0.3])
    for theta, cost in [(0.1, sphere([0.1])), (0.6, sphere([0.6])), (0.3, value), (0.3, value)]:
        live.tell([theta], cost)
        filed.tell([theta], json.loads(json.dumps(cost)))
    np.testing.assert_array_equal(live.ask(), filed.ask())


def test_a_long_search_is_replayed_wherever_it_is_taken_up():
    # Full fits alternate with short ones that start at their result: whoever was not there must find it, too.
    points = np.random.default_rng(0).random((38, 2))
    live = Optimizer(cube(2), seed=1)
    for count, theta in enumerate(points):
        live.tell(theta, sphere(theta), failed=False)
        if count + 1 in (29, 30, 31, 33, 34, 35, 36, 38):
            resumed = Optimizer(cube(2), seed=1)
            for each in points[: count + 1]:
                resumed.tell(each, sphere(each))
            if count % 2:
                resumed.predict([0.5, 0.5])
            np.testing.assert_array_equal(resumed.ask(), live.ask())


def test_full_fits_become_rarer_and_each_number_of_trials_has_the_one_before_it():
    numbers = range(1, 1601)
    full = [told for told in numbers if last_full_fit(told) == told]
    assert [last_full_fit(told) for told in numbers] == [max(f for f in full if f <= told) for told in numbers]
    assert full[:30] == list(range(1, 31))
    apart = np.diff(full[29:])
    assert apart[0] == 5
    assert sorted(apart) == apart.tolist()
    assert np.all(apart <= 0.1 * np.array(full[30:]) + 2)


def test_beyond_the_active_set_the_search_goes_on_and_knows_its_best():
    search = Optimizer(cube(2), seed=0, active_set=15)
    for theta in np.random.default_rng(0).random((40, 2)):
        search.tell(theta, sphere(theta), failed=False)
    run(search, sphere, 5, fails=lambda theta: theta[0] > 0.9)
    assert search.best.cost < 0.101
    assert search.best_estimated.cost == pytest.approx(0.1, abs=0.01)
    again = Optimizer(cube(2), seed=0, active_set=15)
    for trial in search.trials:
        again.tell(trial.theta, trial.cost, failed=trial.failed)
    np.testing.assert_array_equal(again.ask(), search.ask())


def test_looking_at_the_model_does_not_change_what_is_asked():
    quiet = run(Optimizer(BRANIN, seed=2, seed_points=5), branin, 9)
    nosy = Optimizer(BRANIN, seed=2, seed_points=5)
    for trial in quiet.trials:
        nosy.ask()
        nosy.tell(trial.theta, trial.cost)
        nosy.predict([0.0, 5.0])
    np.testing.assert_array_equal(nosy.ask(), quiet.ask())


def test_a_new_process_asks_the_very_same_point():
    search = run(Optimizer(BRANIN, seed=3, seed_points=5), branin, 9)
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


def test_a_deterministic_cost_is_asked_twice_at_one_place_at_most_once():
    search = run(Optimizer(cube(1), seed=0, seed_points=4), sphere, 14)
    assert repeats(told(search)) <= 1
    assert search.best.cost == pytest.approx(0.1, abs=1e-6)


def test_points_are_apart_even_when_the_minimum_is_found():
    search = run(Optimizer(cube(2), seed=1, seed_points=5), sphere, 15)
    assert repeats(told(search), 1e-4) <= 1


def test_costs_over_forty_decades_do_not_break_it():
    for transform in ("log", "log-half-rank"):
        search = Optimizer(cube(2), seed=0, seed_points=5, transform=transform)
        run(search, lambda theta: float(np.exp(150 * sphere(theta))), 10)
        assert np.log(search.best.cost) / 150 < 0.12


@pytest.mark.parametrize("seed", [1])
def test_the_default_holds_on_costs_with_a_heavy_tail(seed):
    # Four decades over the box, flat near the best, as costs of closed loops are.
    def cost(theta):
        return float(10.0 * np.exp(12 * (sphere(theta) - 0.1)))

    found = run(Optimizer(cube(4), seed=seed, seed_points=8), cost, 22).best.cost
    # In the logarithm a third of what a space-filling search leaves.
    sobol = run(SobolSearch(cube(4), seed=seed), cost, 22).best.cost
    assert np.log(found / 10.0) < np.log(sobol / 10.0) / 3


def test_prediction_is_on_the_scale_that_is_modelled():
    search = run(Optimizer(cube(2), seed=0, seed_points=8, transform="log"), sphere, 11)
    mean, std = search.predict([0.3, 0.35])
    other, _ = search.predict([0.5, 0.35])
    assert other - mean == pytest.approx(np.log(0.1425 / 0.1025), abs=0.05)
    assert 0 < std < 0.1
    with pytest.raises(ValueError, match="nothing can be predicted"):
        Optimizer(cube(2)).predict([0.5, 0.5])


def test_start_points_are_told_to_the_model_and_their_neighbourhood_is_searched():
    # A datasheet's theta near the optimum of a cost that is flat elsewhere.
    def cost(theta):
        return 10.0 - float(np.exp(-40 * np.sum((theta - 0.72) ** 2)))

    search = run(Optimizer(cube(4), seed=0, seed_points=6, initial=[[0.7, 0.65, 0.75, 0.7]]), cost, 20)
    np.testing.assert_array_equal(search.trials[0].theta, [0.7, 0.65, 0.75, 0.7])
    assert search.best.cost < 9.02
    assert run(Optimizer(cube(4), seed=0, seed_points=6), cost, 6).best.cost > 9.5


def test_start_points_are_asked_even_beyond_the_number_of_seed_points():
    first = np.random.default_rng(0).random((5, 2))
    search = run(Optimizer(cube(2), seed=0, seed_points=2, initial=first), sphere, 5)
    np.testing.assert_array_equal(told(search), first)


@pytest.mark.parametrize("seed_points", [1, 8])
def test_start_points_are_asked_whatever_else_was_told_before(seed_points):
    first = np.random.default_rng(0).random((3, 2))
    search = Optimizer(cube(2), seed=0, seed_points=seed_points, initial=first)
    for theta in ([0.9, 0.9], first[1], [0.8, 0.8]):
        search.tell(theta, sphere(theta))
    np.testing.assert_array_equal(search.ask(), first[0])
    np.testing.assert_array_equal(search.ask(pending=[first[0]]), first[2])
    assert not np.any(np.all(search.ask(pending=first[[0, 2]]) == first, axis=1))


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
        ({"acquisition": "pi"}, "unknown acquisition 'pi'; known are 'log_ei', 'ei', 'noisy_ei', 'ucb'"),
        ({"transform": "sqrt"}, "unknown transform 'sqrt'; known are "),
        ({"mean": None}, "unknown mean None; known are 'constant', 'zero'"),
        ({"noise": -1.0}, "noise is -1.0"),
        ({"seed": -1}, "seed is -1"),
        ({"seed": 1.5}, "seed is 1.5"),
        ({"seed_points": 0}, "seed_points is 0"),
        ({"active_set": 0}, "active_set is 0"),
        ({"initial": [[0.5, 2.0]]}, r"theta\[1\] \(x1\) is 2.0, outside its bounds"),
        ({"limits": {"overshoot": np.nan}}, "the limit of 'overshoot' is nan"),
    ],
)
def test_a_setting_that_makes_no_sense_is_refused(settings, said):
    with pytest.raises(ValueError, match=said):
        Optimizer(cube(2), **settings)


@pytest.mark.parametrize("kind", [Optimizer, SobolSearch])
@pytest.mark.parametrize(
    ("told", "said"),
    [
        ({"theta": [0.5], "cost": 1.0}, r"shape \(1,\)"),
        ({"theta": [0.5, 1.5], "cost": 1.0}, r"theta\[1\] \(x1\) is 1.5"),
        ({"theta": [0.5, np.nan], "cost": 1.0}, r"theta\[1\] \(x1\) is nan"),
        ({"cost": np.nan}, "the cost is nan: it must be finite; tell failed=True"),
        ({"cost": np.inf}, "the cost is inf: it must be finite; tell failed=True"),
        ({"cost": "low"}, "the cost must be a number, not 'low'"),
        ({"cost": 1.0, "failed": True}, "tell a cost, or at_least, or failed=True"),
        ({"cost": 1.0, "at_least": 1.0}, "tell a cost, or at_least, or failed=True"),
        ({"at_least": 1.0, "failed": True}, "tell a cost, or at_least, or failed=True"),
        ({}, "tell a cost, or at_least, or failed=True"),
        ({"at_least": np.inf}, "the least cost of a trial that was cut is inf"),
        ({"cost": 1.0, "deviation": -1.0}, "the deviation of the cost is -1.0: it cannot be negative"),
        ({"cost": 1.0, "deviation": np.nan}, "the deviation is nan"),
        ({"cost": 1.0, "measured": {"overshoot": 1.0}}, "'overshoot' was measured, but the limits are on"),
    ],
)
def test_a_telling_that_makes_no_sense_is_refused_and_not_recorded(kind, told, said):
    search = kind(cube(2))
    with pytest.raises(ValueError, match=said):
        search.tell(**({"theta": [0.5, 0.5]} | told))
    assert search.trials == ()


@pytest.mark.parametrize("kind", [Optimizer, SobolSearch])
def test_each_limited_quantity_is_told_with_a_cost(kind):
    search = kind(cube(2), limits={"overshoot": 0.1, "settling": 2.0})
    with pytest.raises(ValueError, match="there is a limit on 'settling': tell it"):
        search.tell([0.5, 0.5], 1.0, measured={"overshoot": 0.0})
    with pytest.raises(ValueError, match="overshoot is nan"):
        search.tell([0.5, 0.5], 1.0, measured={"overshoot": np.nan, "settling": 1.0})
    search.tell([0.5, 0.5], failed=True)
    search.tell([0.5, 0.5], at_least=1.0, measured={"overshoot": 0.0})
    search.tell([0.5, 0.5], 1.0, measured={"overshoot": 0.0, "settling": 1.0})
    assert len(search.trials) == 3


def test_a_cost_that_has_no_logarithm_is_refused():
    search = Optimizer(cube(1), transform="log")
    for outcome in ({"cost": 0.0}, {"cost": -2.0}, {"at_least": 0.0}):
        with pytest.raises(ValueError, match=r'its logarithm or power is modelled: use transform="[a-z-]+" for J'):
            search.tell([0.5], **outcome)
    assert search.trials == ()
    Optimizer(cube(1)).tell([0.5], -3.0)


def test_a_cost_of_any_size_is_taken_and_the_search_goes_on():
    search = Optimizer(cube(1), seed_points=3)
    for x, cost in ((0.1, 1.0), (0.4, 0.5), (0.9, 1e300), (0.95, 1e123)):
        search.tell([x], cost)
    search.tell([0.8], at_least=1e250)
    assert 0.0 <= search.ask()[0] < 0.8
    assert search.best_estimated.index in (0, 1)  # of costs over 300 decades
