"""Limits on what is measured, and conditions known before any experiment."""

import numpy as np
import pytest
from tune_support import cube, repeats, told

from socasadi.tune import Optimizer, Parameter, SobolSearch, Space

# Gardner, Kusner, Xu, Weinberger and Cunningham 2014, "Bayesian optimization with inequality constraints", section 4.
GARDNER = Space([Parameter("x", "", 0, 6), Parameter("y", "", 0, 6)])
GARDNER_1 = (
    lambda t: float(np.cos(2 * t[0]) * np.cos(t[1]) + np.sin(t[0])),
    lambda t: float(np.cos(t[0]) * np.cos(t[1]) - np.sin(t[0]) * np.sin(t[1])),
    0.5,
)
GARDNER_2 = (lambda t: float(np.sin(t[0]) + t[1]), lambda t: float(np.sin(t[0]) * np.sin(t[1])), -0.95)


def limited(search, cost, measure, trials, name="load"):
    for _ in range(trials):
        theta = search.ask()
        search.tell(theta, cost(theta), measured={name: measure(theta)})
    return search


def grid_minimum(cost, measure, limit):
    axis = np.linspace(0, 6, 601)
    points = np.stack(np.meshgrid(axis, axis), axis=-1).reshape(-1, 2)
    costs, loads = np.array([[cost(point), measure(point)] for point in points]).T
    return costs[loads <= limit].min()


def bowl(theta):
    return 0.1 + float(np.sum((theta - 0.8) ** 2))


def test_the_best_that_keeps_a_limit_is_found_on_its_border():
    # The foot of the perpendicular from (0.8, 0.8) on x + y = 1 is (0.5, 0.5).
    search = limited(
        Optimizer(cube(2), seed=0, seed_points=6, limits={"load": 1.0}), bowl, lambda t: float(t.sum()), 15
    )
    best = search.best
    assert best.theta.sum() <= 1.0
    assert best.cost == pytest.approx(0.1 + 0.18, abs=5e-3)
    assert np.linalg.norm(best.theta - 0.5) < 0.08
    # The free minimum at (0.8, 0.8) was not what it was after.
    assert min(trial.cost for trial in search.trials) < 0.27
    assert sum(trial.theta.sum() > 1.1 for trial in search.trials[6:]) <= 4


@pytest.mark.slow
def test_two_limits_are_kept_at_once():
    search = Optimizer(cube(2), seed=0, seed_points=6, limits={"sum": 1.0, "first": 0.3})
    for _ in range(15):
        theta = search.ask()
        search.tell(theta, bowl(theta), measured={"sum": float(theta.sum()), "first": float(theta[0])})
    # x = 0.3, y = 0.7.
    assert search.best.cost == pytest.approx(0.1 + 0.25 + 0.01, abs=0.01)
    assert search.best.theta[0] <= 0.3


@pytest.mark.slow
def test_gardners_first_problem_is_solved():
    cost, measure, limit = GARDNER_1
    search = limited(Optimizer(GARDNER, seed=0, seed_points=8, limits={"load": limit}), cost, measure, 22)
    assert measure(search.best.theta) <= limit
    assert search.best.cost < grid_minimum(cost, measure, limit) + 0.05


@pytest.mark.slow
def test_gardners_second_problem_is_solved_though_few_points_keep_its_limit():
    cost, measure, limit = GARDNER_2
    search = Optimizer(GARDNER, seed=0, seed_points=8, limits={"load": limit})
    limited(search, cost, measure, 8)
    assert search.best is None  # 1.4 % of the box keep it
    assert search.best_estimated is None
    limited(search, cost, measure, 20)
    assert measure(search.best.theta) <= limit
    assert measure(search.best_estimated.theta) <= limit
    assert search.best.cost < grid_minimum(cost, measure, limit) + 0.05


def test_where_nothing_keeps_the_limits_there_is_no_best_and_the_least_violation_is_sought():
    search = limited(
        Optimizer(cube(2), seed=0, seed_points=5, limits={"load": -1.0}), bowl, lambda t: float(t[0] + t[1]), 11
    )
    assert search.best is None
    assert search.best_estimated is None
    assert min(trial.theta.sum() for trial in search.trials[5:]) < 0.1
    assert repeats(told(search), 1e-4) <= 1


def test_a_limit_that_all_keep_changes_little():
    found = limited(
        Optimizer(cube(2), seed=0, seed_points=5, limits={"load": 10.0}), bowl, lambda t: float(t.sum()), 11
    ).best.cost
    assert found < 0.102


def test_measurements_of_cut_trials_teach_the_limit():
    # Trials cut short still measured their load: with them no experiment is needed to know that x < 0.5 is too much.
    search = Optimizer(cube(2), seed=0, seed_points=4, limits={"load": 0.5})
    for theta in np.random.default_rng(0).random((16, 2)):
        load = float(1 - theta[0])
        if theta[0] < 0.5:
            search.tell(theta, at_least=0.2, measured={"load": load})
        else:
            search.tell(theta, sphere_at_left(theta), measured={"load": load})
    assert search.ask()[0] > 0.4
    assert search.best.theta[0] >= 0.5


def sphere_at_left(theta):
    return 0.3 + float((theta[0] - 0.1) ** 2 + (theta[1] - 0.5) ** 2)


def in_disc(theta):
    return bool(np.linalg.norm(theta - 0.5) <= 0.3)


def slope(theta):
    return 1.0 + float(theta.sum())


def test_thousands_of_space_filling_points_keep_the_conditions():
    calls = []

    def admissible(theta):
        calls.append(theta)
        return in_disc(theta)

    search = SobolSearch(cube(2), seed=0, admissible=admissible)
    points = np.array([search.ask(np.zeros((count, 2)) + 0.5) for count in range(3000)])
    assert np.linalg.norm(points - 0.5, axis=1).max() <= 0.3
    assert len(np.unique(points, axis=0)) == 3000
    assert len(calls) < 5 * 3000
    seeds = Optimizer(cube(2), seed=0, seed_points=3000, admissible=in_disc)
    np.testing.assert_array_equal([seeds.ask(np.full((count, 2), 0.5)) for count in range(0, 3000, 100)], points[::100])


def test_no_inadmissible_point_is_asked_and_the_best_on_the_border_is_found():
    search = Optimizer(cube(2), seed=0, seed_points=5, admissible=in_disc)
    for _ in range(6):
        batch = []
        for _ in range(3):
            batch.append(search.ask(batch))
            assert in_disc(batch[-1])
        for theta in batch:
            search.tell(theta, slope(theta), failed=False)
    # On the disc's border, down the diagonal.
    assert search.best.cost == pytest.approx(2 - 0.3 * np.sqrt(2), abs=5e-3)


@pytest.mark.parametrize("seed", [0, 1])
def test_on_the_border_of_the_conditions_no_point_is_asked_twice(seed):
    search = Optimizer(cube(2), seed=seed, seed_points=5, admissible=in_disc)
    for _ in range(14):
        theta = search.ask()
        search.tell(theta, slope(theta))
    assert repeats(told(search)) <= 1
    assert repeats(told(search), 1e-5) <= 2


def test_a_told_point_that_is_not_admissible_is_not_asked_again():
    # It was flown by hand, with a cost too good to be true.
    rng = np.random.default_rng(0)
    search = Optimizer(cube(2), seed=0, seed_points=4, admissible=in_disc)
    search.tell([0.05, 0.05], 0.01)
    for _ in range(9):
        theta = search.ask()
        assert in_disc(theta)
        search.tell(theta, slope(theta) + 0.3 * rng.standard_normal())


def test_a_start_point_that_is_not_admissible_is_refused_or_left_out():
    try:
        search = Optimizer(cube(2), initial=[[0.05, 0.05], [0.5, 0.5]], admissible=in_disc)
    except ValueError:
        return
    assert in_disc(search.ask())


def test_a_thin_admissible_set_in_six_dimensions_is_searched():
    # A slab of 2 % of the box, through the optimum.
    def admissible(theta):
        return bool(abs(theta[0] - theta[1]) < 0.01)

    search = Optimizer(cube(6), seed=0, seed_points=8, admissible=admissible)
    for _ in range(16):
        theta = search.ask()
        assert admissible(theta)
        search.tell(theta, 0.1 + float(np.sum((theta - 0.3) ** 2)))
    assert search.best.cost < min(trial.cost for trial in search.trials[:8])


@pytest.mark.parametrize("kind", [Optimizer, SobolSearch])
def test_a_box_of_which_the_conditions_leave_nothing_gives_one_sentence(kind):
    search = kind(cube(3), admissible=lambda theta: False)
    with pytest.raises(ValueError, match="keeps the conditions: widen the bounds, or loosen them") as caught:
        search.ask()
    assert "\n" not in str(caught.value)


def test_conditions_that_end_up_leaving_nothing_to_ask_give_one_sentence():
    search = Optimizer(cube(2), seed=0, seed_points=2, admissible=lambda theta: False)
    for theta in np.random.default_rng(0).random((5, 2)):
        search.tell(theta, slope(theta))
    with pytest.raises(ValueError, match="keeps the conditions: widen the bounds, or loosen") as caught:
        search.ask()
    assert "\n" not in str(caught.value)
