"""What a Gaussian process library does to the unwary, and does not do to those who search with this one."""

import json
import subprocess
import sys

import numpy as np
import pytest
from tune_support import BRANIN, branin, cube, repeats, run, sphere, told

from socasadi.tune import Optimizer, Parameter, Space


def boxes(lower, upper, d=3):
    return Space([Parameter(f"x{i}", "", lower, upper) for i in range(d)])


def test_nothing_heavy_is_imported_before_the_first_fit_and_the_process_stays_as_it_was():
    code = """
import sys, warnings
import numpy as np
from socasadi.tune import Optimizer, Parameter, Space
warnings.simplefilter("error", DeprecationWarning)
search = Optimizer(Space([Parameter("x", "", 0, 1)]), seed_points=3)
for _ in range(3):
    theta = search.ask()
    search.tell(theta, float(theta[0] ** 2))
heavy = {"GPy", "matplotlib"} & set(sys.modules)
assert not heavy, f"{heavy} imported before they were needed"
filters, errors, options = list(warnings.filters), np.geterr(), np.get_printoptions()
state = np.random.get_state()[1].copy()
search.ask()
search.best_estimated
assert "GPy" in sys.modules
assert list(warnings.filters) == filters, "the warning filters changed"
assert np.geterr() == errors and np.get_printoptions() == options
assert (np.random.get_state()[1] == state).all(), "the global random state moved"
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout == ""


def test_hyperparameters_are_plain_numbers():
    search = Optimizer(BRANIN, seed=0, seed_points=5)
    assert search.hyperparameters == {}
    run(search, branin, 6)
    search.ask()
    hyper = search.hyperparameters
    assert set(hyper) == {"mean", "variance", "additive", "noise", "lengthscale:x", "lengthscale:y"}
    assert all(type(value) is float for value in hyper.values())
    assert json.loads(json.dumps(hyper)) == hyper


@pytest.mark.parametrize(("lower", "upper"), [(0.0, 2.0**20), (0.0, 2.0**-30)])
def test_the_width_of_the_box_does_not_matter(lower, upper):
    # Powers of two scale without rounding, so the very same points are asked.
    narrow, wide = (
        Optimizer(boxes(0.0, 1.0), seed=1, seed_points=5),
        Optimizer(boxes(lower, upper), seed=1, seed_points=5),
    )
    width = upper - lower
    for _ in range(7):
        theta = wide.ask()
        unit = (theta - lower) / width
        np.testing.assert_array_equal(unit, narrow.ask())
        narrow.tell(unit, sphere(unit))
        wide.tell(theta, sphere(unit))


@pytest.mark.parametrize("width", [1e6, 1e-9])
def test_odd_widths_differ_by_rounding_only(width):
    units = np.random.default_rng(0).random((12, 3))
    narrow, wide = (
        Optimizer(boxes(0.0, 1.0), seed=1, seed_points=5),
        Optimizer(boxes(0.0, width), seed=1, seed_points=5),
    )
    for unit in units:
        narrow.tell(unit, sphere(unit))
        wide.tell(width * unit, sphere(unit))
    np.testing.assert_allclose(wide.ask() / width, narrow.ask(), atol=1e-3)
    narrow_scales, wide_scales = ([v for k, v in s.hyperparameters.items() if ":" in k] for s in (narrow, wide))
    np.testing.assert_allclose(wide_scales, narrow_scales, rtol=1e-2)


def test_the_callers_arrays_are_neither_kept_nor_changed():
    limits, start = {"load": 0.5}, [np.array([0.4, 0.4])]

    def new():
        return Optimizer(cube(2), seed=0, seed_points=4, initial=start, limits=limits)

    rng = np.random.default_rng(0)
    search, twin = new(), new()
    for _ in range(7):
        theta, measured = rng.random(2), {"load": float(rng.random())}
        twin.tell(theta.copy(), sphere(theta), measured=dict(measured))
        kept = theta.copy()
        search.tell(theta, sphere(theta), measured=measured)
        np.testing.assert_array_equal(theta, kept)
        theta[:] = 0.0
        measured["load"] = -1.0
    limits["load"] = 9.0
    pending = [np.array([0.1, 0.2]), np.array([0.7, 0.7])]
    expected = twin.ask([point.copy() for point in pending])
    asked = search.ask(pending)
    np.testing.assert_array_equal(asked, expected)
    np.testing.assert_array_equal(pending, [[0.1, 0.2], [0.7, 0.7]])
    pending[0][:] = 0.9
    asked[:] = 0.0
    np.testing.assert_array_equal(search.ask([[0.1, 0.2], [0.7, 0.7]]), expected)
    assert not search.trials[0].theta.flags.writeable
    first = new()
    first.ask()[:] = 0.0
    start[0][:] = 0.0
    np.testing.assert_array_equal(first.ask(), [0.4, 0.4])


def test_the_global_random_state_is_neither_read_nor_moved():
    def asked(seed):
        np.random.seed(seed)  # noqa: NPY002
        search = Optimizer(cube(2), seed=0, seed_points=4, acquisition="noisy_ei")
        run(search, sphere, 5, fails=lambda theta: theta[0] > 0.8)
        state = np.random.get_state()[1].copy()  # noqa: NPY002
        point = search.ask([[0.2, 0.2]])
        np.testing.assert_array_equal(np.random.get_state()[1], state)  # noqa: NPY002
        return point

    np.testing.assert_array_equal(asked(1), asked(2))


@pytest.mark.parametrize("cost", [5.0, 0.0, 1e12])
def test_constant_costs_are_searched_on_and_nowhere_twice(cost):
    search = run(Optimizer(cube(2), seed=0, seed_points=4), lambda theta: float(repr(cost)), 8)
    assert np.isfinite(told(search)).all()
    assert repeats(told(search), 1e-4) <= 1
    estimate = search.best_estimated
    assert estimate.cost == pytest.approx(cost, rel=1e-3, abs=1e-4)
    assert estimate.low <= cost <= estimate.high
    assert all(np.isfinite(value) for value in search.hyperparameters.values())


@pytest.mark.parametrize("noise", ["fitted", 1e-6])
def test_contradicting_costs_at_one_point_count_as_their_average(noise):
    search = Optimizer(cube(2), seed=0, transform="none", noise=noise)
    for theta in np.random.default_rng(0).random((12, 2)):
        search.tell(theta, sphere(theta))
    for cost in (0.0, 0.2, 0.0, 0.2):
        search.tell([0.3, 0.3], cost)
    mean, std = search.predict([0.3, 0.3])
    assert mean == pytest.approx(0.1, abs=0.05)
    assert np.isfinite(std)
    assert search.hyperparameters["variance"] > 0.01
    assert np.isfinite(search.ask()).all()


@pytest.mark.parametrize("transform", ["power", "log-half-rank"])
def test_one_huge_outlier_does_not_spoil_the_search(transform):
    search = Optimizer(cube(2), seed=0, seed_points=6, transform=transform)
    search.tell([0.9, 0.1], 1e12)
    run(search, sphere, 13)
    assert search.best.cost < 0.105


def test_smooth_data_leave_a_noise_that_can_be_computed_with():
    search = Optimizer(cube(2), seed=0, transform="none")
    for theta in np.random.default_rng(0).random((40, 2)):
        search.tell(theta, float(np.sin(3 * theta[0]) + theta[1] ** 2))
    mean, std = search.predict([0.5, 0.5])
    assert mean == pytest.approx(np.sin(1.5) + 0.25, abs=2e-3)
    assert 0 < std < 0.05
    assert search.hyperparameters["noise"] >= 0.99e-6
    assert np.isfinite(search.ask()).all()


def test_a_hundred_points_in_one_place_do_not_stop_it():
    search = Optimizer(cube(3), seed=0, seed_points=4)
    for i in range(30):
        theta = np.full(3, 0.5) + 1e-9 * i
        search.tell(theta, sphere(theta))
    search.tell([0.1, 0.9, 0.5], 3.0)
    assert np.abs(search.ask() - 0.5).max() > 1e-4


def test_two_asks_give_the_same_point_whatever_was_looked_at_between():
    search = run(Optimizer(BRANIN, seed=2, seed_points=4), branin, 6)
    first = search.ask()
    other = search.ask([first])
    search.predict([0.0, 5.0])
    assert search.best_estimated is not None
    np.testing.assert_array_equal(search.ask(), first)
    np.testing.assert_array_equal(search.ask([first]), other)
    assert not np.array_equal(first, other)
