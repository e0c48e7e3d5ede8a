"""Noisy costs, costs of known deviation, and costs of which only a lower bound is known."""

import numpy as np
import pytest
from scipy.stats import qmc
from tune_support import BRANIN, BRANIN_MINIMUM, branin, cube, repeats, run, sphere, told

from socasadi.tune import Optimizer, SobolSearch


def quadratic(theta):
    return 1.0 + float(4 * np.sum((np.asarray(theta) - 0.4) ** 2))


def noisy_search(seed, noise=0.3):
    """A search that was told noisy costs at space-filling points."""
    rng = np.random.default_rng(seed)
    search = Optimizer(cube(2), seed=seed)
    for theta in qmc.Sobol(2, rng=rng).random_base2(5):
        search.tell(theta, quadratic(theta) + noise * rng.standard_normal())
    return search


@pytest.fixture(scope="module")
def searches():
    return [noisy_search(seed) for seed in range(24)]


def test_the_best_estimated_is_nearer_to_the_truth_than_the_best_observed(searches):
    observed = [abs(search.best.cost - quadratic(search.best.theta)) for search in searches]
    estimated = [abs(s.best_estimated.cost - quadratic(s.best_estimated.theta)) for s in searches]
    assert np.median(estimated) < 0.5 * np.median(observed)
    # And the choice itself is better: the luckiest is not the best.
    assert np.mean([quadratic(s.best_estimated.theta) for s in searches]) < np.mean(
        [quadratic(s.best.theta) for s in searches]
    )


def test_its_interval_covers_the_truth_about_as_often_as_it_says(searches):
    inside, widths = [], []
    for search in searches:
        estimate = search.best_estimated
        assert estimate.low < estimate.cost < estimate.high
        np.testing.assert_array_equal(estimate.theta, search.trials[estimate.index].theta)
        inside.append(estimate.low <= quadratic(estimate.theta) <= estimate.high)
        widths.append(estimate.high - estimate.low)
    # Of 24 draws at 90 % fewer than 18 come out in one case of two hundred; at 80 % in one of six.
    assert sum(inside) >= 18
    # It would be no art to cover it with an interval wider than that of one observation, 2 x 1.645 x 0.3.
    assert np.median(widths) < 0.99


def test_without_noise_the_best_estimated_is_the_best_observed_and_sure():
    search = run(Optimizer(cube(2), seed=0, seed_points=6), sphere, 12)
    estimate = search.best_estimated
    assert estimate.cost == pytest.approx(search.best.cost, abs=1e-3)
    assert sphere(estimate.theta) < search.best.cost + 1e-3
    assert estimate.high - estimate.low < 0.02


@pytest.mark.parametrize("count", [3, 6, 12, 20])
def test_of_few_trials_that_show_no_noise_the_best_observed_is_taken(count):
    rng, search = np.random.default_rng(count), Optimizer(cube(3))
    for theta in rng.uniform(size=(count, 3)):
        search.tell(theta, 3 + 4 * float(np.exp(6 * np.sum((theta - 0.4) ** 2))) + 0.1 * rng.standard_normal())
    estimate = search.best_estimated
    assert estimate.theta.tolist() == search.best.theta.tolist()
    assert estimate.low < estimate.cost < estimate.high


def test_of_more_trials_a_much_worse_one_is_hardly_ever_taken():
    def steep(theta):
        return 3 + 4 * float(np.exp(6 * np.sum((theta - 0.4) ** 2)))

    worse = 0
    for seed in range(8):
        rng, search = np.random.default_rng(seed), Optimizer(cube(3), seed=seed)
        for theta in rng.uniform(size=(24, 3)):
            search.tell(theta, steep(theta) + 0.1 * rng.standard_normal())
        worse += steep(search.best_estimated.theta) > steep(search.best.theta) + 0.5
    assert worse <= 1


def test_one_trial_alone_says_nothing_of_its_noise_and_neither_do_space_filling_points():
    for search in (Optimizer(cube(2)), SobolSearch(cube(2))):
        assert search.best_estimated is None
        search.tell([0.2, 0.2], 3.0)
        assert search.best_estimated is None


def test_a_search_under_noise_comes_nearer_than_the_noise_is_large():
    rng = np.random.default_rng(0)
    search = run(Optimizer(cube(2), seed=0, seed_points=8), lambda t: quadratic(t) + 0.2 * rng.standard_normal(), 24)
    assert quadratic(search.best_estimated.theta) - 1.0 < 0.1
    assert abs(search.best_estimated.cost - quadratic(search.best_estimated.theta)) < 0.2


def test_what_came_out_the_same_twice_is_asked_no_more():
    search = Optimizer(cube(1), seed=0)
    for x in (0.0, 0.2, 0.4, 0.4, 0.6, 0.8, 1.0):
        search.tell([x], quadratic([x]))
    run(search, quadratic, 6)
    assert repeats(told(search)) == 1


def test_equal_costs_of_a_known_deviation_are_not_taken_for_exact():
    search = Optimizer(cube(2), seed=0, seed_points=4)
    for theta in [*np.random.default_rng(0).random((12, 2)), [0.4, 0.4], [0.4, 0.4]]:
        search.tell(theta, round(3 * quadratic(theta)), deviation=1.0)
    estimate = search.best_estimated
    assert estimate.high - estimate.low > 0.3  # of one observation 3.3


@pytest.mark.parametrize("transform", ["none", "log", "power"])
def test_a_cost_of_large_deviation_moves_the_model_less_than_an_exact_one(transform):
    def predicted(deviation, cost):
        search = Optimizer(cube(1), seed=0, transform=transform, noise=1e-4)
        for x in np.linspace(0, 1, 11):
            search.tell([x], 2.0 + float(np.sin(4 * x)), deviation=0.0)
        search.tell([0.55], cost, deviation=deviation)
        return search.predict([0.55])[0]

    exact, vague, right = predicted(0.0, 4.0), predicted(10.0, 4.0), predicted(10.0, 2.0 + float(np.sin(2.2)))
    assert abs(vague - right) < 0.25 * abs(exact - right)


def test_a_deviation_counts_on_the_scale_of_the_cost():
    # Twenty observations of deviation 0.5 at one place leave its mean uncertain by 0.5 / sqrt(20).
    rng = np.random.default_rng(0)
    search = Optimizer(cube(1), seed=0, transform="none", noise=1e-6)
    for x in (0.0, 1.0):
        search.tell([x], 10.0 * x, deviation=1e-3)
    for _ in range(20):
        search.tell([0.5], 5.0 + 0.5 * rng.standard_normal(), deviation=0.5)
    assert search.predict([0.5])[1] == pytest.approx(0.5 / np.sqrt(20), rel=0.2)
    assert search.predict([1.0])[1] < 0.05


@pytest.mark.parametrize("transform", ["log", "power"])
def test_a_deviation_larger_than_its_cost_is_taken(transform):
    search = Optimizer(cube(1), seed=0, seed_points=3, transform=transform)
    for x in (0.1, 0.4, 0.7, 0.9):
        search.tell([x], quadratic([x]), deviation=100.0)
    assert np.isfinite(search.ask()).all()
    assert np.isfinite(search.predict([0.5])).all()


@pytest.mark.parametrize("transform", ["none", "log", "power"])
def test_a_bound_is_not_a_value(transform):
    def predicted(**told):
        search = Optimizer(cube(1), seed=0, transform=transform)
        for x in np.linspace(0, 1, 11):
            if abs(x - 0.5) > 0.01:
                search.tell([x], 10.0 - 8.0 * float(np.exp(-50 * (x - 0.05) ** 2)))
        if told:
            search.tell([0.5], **told)
        return search.predict([0.5])[0], search

    without, value, (bound, search) = predicted()[0], predicted(cost=3.0)[0], predicted(at_least=3.0)
    assert bound > without - 0.2 * (without - value)
    # It is no cost, either.
    assert search.best.cost < 3.0
    assert search.trials[-1].cost is None
    assert not search.trials[-1].failed


@pytest.mark.parametrize("transform", ["none", "log", "power"])
def test_a_bound_above_what_was_believed_lifts_the_model(transform):
    def predicted(**told):
        search = Optimizer(cube(1), seed=0, transform=transform)
        for x in (0.0, 0.1, 0.2, 0.3, 0.4, 0.6, 0.7, 0.8, 0.9, 1.0):
            search.tell([x], 6.0 + 3.0 * float(np.sin(6 * x)))
        search.tell([0.5], **told)
        return search.predict([0.5])[0]

    # The function itself is 6.4 there.
    believed, bound, value = predicted(at_least=4.0), predicted(at_least=8.0), predicted(cost=8.0)
    assert bound > believed
    assert bound > value - 0.1 * abs(value)


@pytest.mark.parametrize("bound", [0.0, -1.0])
def test_a_bound_that_is_not_positive_among_positive_costs_is_taken(bound):
    search = Optimizer(cube(1), seed=0)
    for x in (0.1, 0.4, 0.7, 0.9):
        search.tell([x], quadratic([x]))
    search.tell([0.5], at_least=bound)
    assert np.isfinite(search.predict([0.5])).all()


def test_while_all_trials_are_cut_it_keeps_exploring():
    search = Optimizer(cube(2), seed=0, seed_points=3)
    for _ in range(6):
        search.tell(search.ask(), at_least=2.0)
    assert search.best is None
    assert search.best_estimated is None
    assert repeats(told(search), 1e-3) == 0


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 2])
def test_experiments_cut_above_one_and_a_half_times_the_best_teach_as_much_as_whole_ones(seed):
    def search(cut):
        search = Optimizer(BRANIN, seed=seed, seed_points=6)
        for _ in range(30):
            theta = search.ask()
            cost, best = branin(theta), search.best
            if cut and best is not None and cost > 1.5 * best.cost:
                search.tell(theta, at_least=1.5 * best.cost)
            else:
                search.tell(theta, cost)
        return search

    whole, cut = search(False), search(True)
    assert sum(trial.cost is None for trial in cut.trials) >= 8
    assert whole.best.cost < BRANIN_MINIMUM + 0.02
    assert cut.best.cost < BRANIN_MINIMUM + 0.02
