"""The merit of a point under fitted processes, and its maximisation over the cube."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import norm
from tune_support import differences

from socasadi.tune.acquisition import SAME_POINT, Constraint, Merit, acquisition_named, maximise
from socasadi.tune.surrogate import FitSettings, Hyperparameters, condition, fit

D, N = 3, 12
POINTS = np.random.default_rng(0).random((N, D))
ACQUISITIONS = ("ei", "log_ei", "noisy_ei", "ucb")


def process(seed, worlds=1, kernel="matern52", warp=None, noise=1e-3):
    rng = np.random.default_rng(seed)
    hyper = Hyperparameters(kernel, 0.2, 1.3, noise, rng.uniform(0.3, 0.9, D), seed % 2 * 0.7, warp, seed % 3 * 0.4)
    return condition(hyper, POINTS, rng.normal(size=(N, worlds)), noise)


@pytest.fixture(scope="module")
def warp():
    """A warping that was fitted to a function steep at one face."""
    targets = np.log(0.02 + POINTS).sum(axis=1)
    targets = (targets - targets.mean()) / targets.std()
    found = fit(POINTS, targets, FitSettings(warp=True, screened=5, restarts=1), np.random.default_rng(0)).warp
    assert found is not None
    assert max(np.abs(np.log(found.a)).max(), np.abs(np.log(found.b)).max()) > 0.05
    return found


@pytest.mark.parametrize("acquisition", ACQUISITIONS)
@pytest.mark.parametrize("worlds", [1, 5])
@pytest.mark.parametrize("kernel", ["matern52", "rbf"])
@pytest.mark.parametrize("constraints", [0, 2])
@pytest.mark.parametrize("warped", [False, True])
def test_gradient_of_the_merit_is_that_of_its_value(acquisition, worlds, kernel, constraints, warped, warp):
    inputs = warp if warped else None
    cost = process(1, worlds, kernel, inputs)
    kept = [Constraint(process(2, 1, kernel, inputs), 0.4), Constraint(process(3, 1, kernel), 0.0, 1.0)][:constraints]
    best = np.linspace(-0.5, 0.5, worlds)
    merit = Merit(acquisition_named(acquisition), cost, best, kept, 1.0 + 1.5 * warped)
    for x in np.random.default_rng(4).uniform(0.05, 0.95, (6, D)):
        value, gradient = merit.with_gradient(x)
        assert value == pytest.approx(merit(x[None])[0], rel=1e-9, abs=1e-12)
        expected = differences(lambda at: merit(at[None])[0], x, 1e-4)
        np.testing.assert_allclose(gradient, expected, rtol=1e-4, atol=1e-6 * max(1.0, np.abs(expected).max()))


def test_worlds_that_are_alike_count_as_one():
    one, log_ei = process(1), acquisition_named("log_ei")
    alike = replace(one, alpha=np.tile(one.alpha, (1, 5)))
    for x in np.random.default_rng(4).random((6, D)):
        value, gradient = Merit(log_ei, one, np.zeros(1)).with_gradient(x)
        same, slope = Merit(log_ei, alike, np.zeros(5)).with_gradient(x)
        assert same == pytest.approx(value, rel=1e-12)
        np.testing.assert_allclose(slope, gradient, rtol=1e-9)


def test_gradient_of_the_probability_alone_is_that_of_its_value():
    merit = Merit(acquisition_named("log_ei"), None, np.zeros(1), [Constraint(process(2), 0.4), Constraint(process(3))])
    for x in np.random.default_rng(4).random((6, D)):
        value, gradient = merit.with_gradient(x)
        assert value == pytest.approx(merit(x[None])[0], rel=1e-9)
        np.testing.assert_allclose(gradient, differences(lambda at: merit(at[None])[0], x), rtol=1e-5, atol=1e-7)


@pytest.mark.parametrize("limit", [-60.0, -8.0, 0.3, 8.0])
def test_the_probability_is_finite_and_has_its_gradient_however_hopeless(limit):
    constraint = Constraint(process(2), limit)
    x = np.array([0.2, 0.7, 0.4])
    value, gradient = constraint.with_gradient(x)
    assert np.isfinite(value)
    np.testing.assert_allclose(
        gradient, differences(lambda at: constraint.log_probability(at[None])[0], x), rtol=1e-5, atol=1e-9
    )


def test_a_constraint_is_the_probability_that_the_quantity_stays_below_its_limit():
    posterior, limit, spread = process(2), 0.4, 0.7
    x = np.random.default_rng(1).random((5, D))
    mean, std = posterior.predict(x)
    for i, value in enumerate(Constraint(posterior, limit, spread).log_probability(x)):
        # Of a latent value with that mean and deviation, and of a normal number of that spread on top of it.
        expected, _ = quad(
            lambda g, i=i: norm.pdf(g, mean[i, 0], std[i]) * norm.cdf((limit - g) / np.sqrt(spread)), -20, 20, limit=200
        )
        assert np.exp(value) == pytest.approx(expected, rel=1e-7)


@pytest.mark.parametrize("acquisition", ACQUISITIONS)
def test_worlds_are_averaged_and_multiplied_by_the_power_of_the_probability(acquisition):
    chosen, worlds = acquisition_named(acquisition), 4
    cost, best = process(1, worlds), np.array([-0.5, 0.0, 0.1, 0.6])
    constraint = Constraint(process(2), 0.4)
    x = np.random.default_rng(2).random((7, D))
    alone = [
        Merit(chosen, replace(cost, alpha=cost.alpha[:, [i]]), best[[i]])(x) for i in range(worlds)
    ]  # each world by itself
    plain = np.mean(np.exp(alone) if chosen.logarithm else alone, axis=0)
    expected = plain * np.exp(constraint.log_probability(x)) ** 3
    value = Merit(chosen, cost, best, [constraint], caution=3.0)(x)
    np.testing.assert_allclose(np.exp(value) if chosen.logarithm else value, expected, rtol=1e-10)


def anywhere(x):
    return True


def two(seed=5):
    rng = np.random.default_rng(seed)
    points = rng.random((8, 2))
    posterior = condition(
        Hyperparameters("matern52", 0.0, 1.0, 1e-4, np.full(2, 0.3)), points, rng.normal(size=(8, 1)), 1e-4
    )
    return posterior, points


@pytest.mark.parametrize("acquisition", ["ei", "log_ei", "ucb"])
def test_the_maximiser_is_not_beaten_by_a_fine_grid(acquisition):
    posterior, points = two()
    merit = Merit(acquisition_named(acquisition), posterior, np.array([-0.8]))
    x, value = maximise(merit, points, points[:2], np.random.default_rng(0), anywhere)
    axis = np.linspace(0, 1, 201)
    grid = merit(np.stack(np.meshgrid(axis, axis), axis=-1).reshape(-1, 2))
    assert value >= grid.max() - 1e-9
    assert value == pytest.approx(merit(x[None])[0], rel=1e-9)


def test_a_point_already_asked_is_not_the_maximiser():
    posterior, points = two()
    merit = Merit(acquisition_named("log_ei"), posterior, np.array([-0.8]))
    first, value = maximise(merit, points, points[:2], np.random.default_rng(0), anywhere)
    second, less = maximise(merit, np.vstack([points, first]), points[:2], np.random.default_rng(0), anywhere)
    assert np.abs(second - first).max() > SAME_POINT
    assert less <= value


def test_where_a_point_may_lie_is_kept_and_its_border_is_reached():
    posterior, points = two()
    merit = Merit(acquisition_named("log_ei"), posterior, np.array([-0.8]))
    free, _ = maximise(merit, points, points[:2], np.random.default_rng(0), anywhere)
    axis = np.linspace(0, 1, 201)
    grid = np.stack(np.meshgrid(axis, axis), axis=-1).reshape(-1, 2)
    for radius in (0.1, 0.3):
        allowed = [x for x in grid if np.linalg.norm(x - free) > radius]

        def outside(x, radius=radius):
            return bool(np.linalg.norm(x - free) > radius)

        x, value = maximise(merit, points, points[:2], np.random.default_rng(0), outside)
        assert outside(x)
        assert value >= merit(np.array(allowed)).max() - 0.3  # in log EI
