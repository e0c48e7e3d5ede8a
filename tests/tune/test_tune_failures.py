"""Failures are outcomes: half the box may fail, and the search still converges and fails seldom."""

import numpy as np
import pytest
from tune_support import cube, repeats, run, sphere, told

from socasadi.tune import Optimizer, SobolSearch


def edge(theta):
    """Least, 0.1, just inside the border of `beyond_half` and at 0.3 in the other coordinates."""
    return 0.1 + float((theta[0] - 0.48) ** 2 + np.sum((theta[1:] - 0.3) ** 2))


def beyond_half(theta):
    return bool(theta[0] > 0.5)


def check_plateau(d, seed, trials):
    """With the half of the box beyond the optimum failing, against the same search without failures."""
    seeds = d + 2
    free = run(Optimizer(cube(d), seed=seed, seed_points=seeds), edge, trials)
    half = run(Optimizer(cube(d), seed=seed, seed_points=seeds), edge, trials, beyond_half)
    random = run(SobolSearch(cube(d), seed=seed), edge, trials, beyond_half)
    # Once it is there, it asks on both sides of the border.
    there = next((i for i, trial in enumerate(half.trials) if trial.cost is not None and trial.cost < 0.101), trials)
    asked = half.trials[seeds:there]
    assert sum(trial.failed for trial in asked) < 0.3 * len(asked)  # half of them at random
    assert half.best.cost - 0.1 < 0.15 * (random.best.cost - 0.1)
    assert half.best.cost - 0.1 < 5 * (free.best.cost - 0.1) + 0.01


@pytest.mark.slow
def test_half_of_a_box_of_six_dimensions_may_fail():
    check_plateau(6, 0, 25)


@pytest.mark.slow
@pytest.mark.parametrize("d", [6, 8, 10])
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_half_of_a_box_may_fail(d, seed):
    check_plateau(d, seed, 30 + 2 * d)


@pytest.mark.slow
@pytest.mark.parametrize(("share", "seed"), [(0.5, 0), (0.25, 1)])
def test_a_box_within_the_box_is_found_whose_every_border_fails(share, seed):
    # No half-space: a search that looks for costs where there are none yet goes from one face of the box to the next.
    half = share ** (1 / 6) / 2
    trials = 40
    search = run(Optimizer(cube(6), seed=seed), sphere, trials, fails=lambda theta: np.abs(theta - 0.45).max() > half)
    asked = search.trials[10:]
    assert sum(not trial.failed for trial in asked) > 0.5 * len(asked)  # at random half of them and a quarter
    assert search.best.cost < 0.12  # 0.1 is the least


def test_failures_steer_the_search_away_and_are_never_the_best():
    search = run(Optimizer(cube(3), seed=0, seed_points=8), sphere, 20, lambda theta: theta[0] > 0.4)
    asked = search.trials[8:]
    assert sum(trial.failed for trial in asked) <= 4  # 7 of 12 points at random
    assert not search.best.failed
    assert not search.trials[search.best_estimated.index].failed
    assert search.best.cost < 0.11


def test_while_all_trials_fail_it_keeps_exploring():
    space = cube(2)
    search = run(Optimizer(space, seed=0, seed_points=4), sphere, 12, fails=lambda theta: True)
    sobol = run(SobolSearch(space, seed=0), sphere, 12)
    assert search.best is None
    assert search.best_estimated is None
    np.testing.assert_array_equal(told(search), told(sobol))
    search.tell([0.3, 0.3], 0.1)
    asked = search.ask()
    assert np.abs(told(search) - asked).max(axis=1).min() > 1e-4
    assert search.best.cost == 0.1


def test_after_a_few_successes_among_failures_it_goes_on_to_succeed_and_to_improve():
    # A disc of 7 % of the box; the first three start points lie in it.
    def fails(theta):
        return bool(np.linalg.norm(theta - [0.7, 0.3]) > 0.15)

    start = [[0.7, 0.3], [0.65, 0.33], [0.72, 0.22]]
    successes = 0
    for seed in range(2):
        search = Optimizer(cube(2), seed=seed, seed_points=8, initial=start)
        run(search, lambda theta: 1.0 + float(theta[0] + theta[1]), 20, fails)
        successes += sum(not trial.failed for trial in search.trials[8:])
        assert search.best.cost < 1.93  # 1.788 at the disc's best, 1.94 at the best of the first three
    assert successes >= 3  # 1.7 of 24 at random


def test_only_the_first_trials_succeed_and_it_goes_on_asking_new_points():
    search = Optimizer(cube(2), seed=0, seed_points=3)
    run(search, sphere, 2)
    run(search, sphere, 9, fails=lambda theta: True)
    points = told(search)
    assert np.isfinite(points).all()
    assert repeats(points, 1e-4) <= 1
    assert search.best.cost == min(trial.cost for trial in search.trials[:2])


def test_failures_at_one_face_do_not_keep_it_from_an_optimum_near_that_face():
    def cost(theta):
        return 0.1 + float((theta[0] - 0.93) ** 2 + (theta[1] - 0.4) ** 2)

    search = run(Optimizer(cube(2), seed=0, seed_points=6), cost, 16, lambda theta: theta[0] > 0.97)
    assert search.best.cost < 0.102
    assert sum(trial.failed for trial in search.trials[6:]) <= 4


def test_a_failure_says_nothing_of_the_cost_elsewhere():
    # A cost model that took failures for large costs would see a cliff.
    search, twin = (Optimizer(cube(2), seed=0, transform="none") for _ in range(2))
    for theta in np.random.default_rng(0).random((12, 2)):
        for each in (search, twin):
            each.tell(theta, sphere(theta))
    for theta in np.random.default_rng(1).uniform(0.6, 1.0, (6, 2)):
        search.tell(theta, failed=True)
    for theta in np.random.default_rng(2).random((10, 2)):
        np.testing.assert_allclose(search.predict(theta)[0], twin.predict(theta)[0], atol=0.02)
