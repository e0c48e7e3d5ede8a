"""Where experiments fail: the classifier against GPy's own, and what it says of simple cases."""

import numpy as np
import pytest
from scipy.stats import lognorm, norm

from socasadi.tune.acquisition import Constraint
from socasadi.tune.surrogate import classify


def cases(n=40, d=2, seed=0):
    points = np.random.default_rng(seed).random((n, d))
    return points, points[:, 0] + 0.3 * points[:, 1] > 0.6


def gpy_model(hyper, points, failed, kernel, method="Laplace"):
    import GPy

    kern = {"rbf": GPy.kern.RBF, "matern52": GPy.kern.Matern52}[kernel](
        points.shape[1], variance=hyper.variance, lengthscale=hyper.lengthscales, ARD=True
    )
    kern = kern + GPy.kern.Bias(points.shape[1], variance=hyper.common)
    inference = getattr(GPy.inference.latent_function_inference, method)()
    return GPy.core.GP(points, failed.astype(float)[:, None], kern, GPy.likelihoods.Bernoulli(), None, inference)


def failing(posterior, x):
    """The probability of failure at points x (m, d)."""
    mean, std = posterior.predict(x)
    return norm.cdf(mean[:, 0] / np.sqrt(1 + std**2))


@pytest.mark.parametrize("kernel", ["matern52", "rbf"])
def test_the_probability_of_failure_is_the_one_gpy_predicts(kernel):
    points, failed = cases()
    posterior = classify(points, failed, kernel)
    x = np.random.default_rng(1).random((30, 2))
    model = gpy_model(posterior.hyperparameters, points, failed, kernel)
    np.testing.assert_allclose(failing(posterior, x), model.predict(x)[0][:, 0], atol=1e-5)
    mean, variance = model.predict_noiseless(x)
    got_mean, got_std = posterior.predict(x)
    np.testing.assert_allclose(got_mean, mean, atol=1e-4)
    np.testing.assert_allclose(got_std**2, variance[:, 0], atol=1e-4)
    success = np.exp(Constraint(posterior, 0.0, 1.0).log_probability(x))
    np.testing.assert_allclose(success, 1 - failing(posterior, x), atol=1e-12)


def test_it_says_much_the_same_as_expectation_propagation():
    # Laplace's method is known to be too cautious (Rasmussen and Williams 2006, section 3.7), never to change sides.
    points, failed = cases()
    posterior = classify(points, failed, "matern52")
    x = np.random.default_rng(1).random((60, 2))
    other = gpy_model(posterior.hyperparameters, points, failed, "matern52", "EP").predict(x)[0][:, 0]
    mine = failing(posterior, x)
    assert np.abs(mine - other).max() < 0.35
    sure = np.abs(other - 0.5) > 0.2
    np.testing.assert_array_equal((mine > 0.5)[sure], (other > 0.5)[sure])


@pytest.mark.parametrize("kernel", ["matern52", "rbf"])
def test_no_other_hyperparameters_nearby_are_more_likely(kernel):
    points, failed = cases(30)
    failed = failed ^ (np.arange(30) % 10 == 0)  # so that the likelihood has a maximum inside
    hyper = classify(points, failed, kernel).hyperparameters

    def density(logs):
        model = gpy_model(hyper, points, failed, kernel)
        model.kern[:] = np.exp([*logs, logs[0]])
        scale = np.exp(np.sqrt(2) + 0.5 * np.log(2))
        prior = lognorm.logpdf(np.exp(logs[1:]), s=np.sqrt(3), scale=scale).sum()
        prior += norm.logpdf(logs[0], np.log(30), 1)
        prior -= 0.5 * np.sum(((logs[1:] - logs[1:].mean()) / 0.5) ** 2)
        return float(np.squeeze(model.log_likelihood())) + prior

    best = np.log([hyper.variance, *hyper.lengthscales])
    rng, top = np.random.default_rng(2), density(best)
    for size in (0.05, 0.3):
        for _ in range(10):
            assert density(best + size * rng.standard_normal(3)) <= top + 0.02


def test_failures_are_told_from_successes_and_the_border_is_between():
    x, fine = np.linspace(0, 1, 21)[:, None], np.linspace(0, 1, 201)
    chance = failing(classify(x, x[:, 0] > 0.62, "matern52"), fine[:, None])
    assert np.all(chance[fine < 0.6] < 0.5)
    assert np.all(chance[fine > 0.65] > 0.5)
    assert chance[40] < 0.3  # at 0.2
    assert chance[180] > 0.7  # at 0.9


@pytest.mark.parametrize("value", [False, True])
def test_one_outcome_alone_is_no_certainty(value):
    points = 0.5 + 0.02 * np.random.default_rng(0).standard_normal((10, 6))
    posterior = classify(points, np.full(10, value), "matern52")
    chance = failing(posterior, np.vstack([points[:1], np.zeros((1, 6))]))
    assert np.isfinite(chance).all()
    assert (chance[0] > 0.5) == value
    assert abs(chance[1] - 0.5) <= abs(chance[0] - 0.5)


def test_both_outcomes_at_one_point_are_a_half():
    points = np.array([[0.5], [0.5], [0.5], [0.5], [0.1], [0.9]])
    posterior = classify(points, np.array([True, False, True, False, False, True]), "matern52")
    assert failing(posterior, np.array([[0.5]]))[0] == pytest.approx(0.5, abs=0.1)


def test_the_callers_arrays_are_neither_changed_nor_kept():
    points, failed = cases(15)
    kept = points.copy(), failed.copy()
    posterior = classify(points, failed, "matern52")
    np.testing.assert_array_equal(points, kept[0])
    np.testing.assert_array_equal(failed, kept[1])
    x = np.full((1, 2), 0.4)
    before = failing(posterior, x)
    points[:] = 0.0
    np.testing.assert_array_equal(failing(posterior, x), before)
