"""Prediction by a Gaussian process in closed form, beside GPy's own and the textbook's."""

import numpy as np
import pytest
from gp_support import QUICK, covariance_of, data, fitted, standardised
from scipy.stats import beta
from tune_support import differences

from socasadi.tune.surrogate import FitSettings, condition, fit


def gpy_model(hyper, points, values, kernel):
    """GPy's own model at those hyperparameters."""
    import GPy

    d = points.shape[1]
    of = {"rbf": GPy.kern.RBF, "matern52": GPy.kern.Matern52}[kernel]
    kern = of(d, variance=hyper.variance, lengthscale=hyper.lengthscales, ARD=True)
    if hyper.additive:
        for i, lengthscale in enumerate(hyper.lengthscales / np.sqrt(d)):
            kern = kern + of(1, variance=hyper.additive / d, lengthscale=lengthscale, active_dims=[i])
    likelihood = GPy.likelihoods.Gaussian(variance=hyper.noise)
    mean = GPy.mappings.Constant(d, 1, value=hyper.mean)
    return GPy.core.GP(points, values[:, None], kern, likelihood, mean_function=mean)


@pytest.mark.parametrize(
    ("kernel", "mean", "additive"),
    # Each setting of each once, and the kernel with both sums.
    [("rbf", "constant", True), ("matern52", "zero", False), ("matern52", "constant", True), ("rbf", "zero", False)],
)
def test_closed_form_prediction_and_gradients_agree_with_gpy(kernel, mean, additive):
    points, values = data()
    values = values + 0.1 * np.random.default_rng(1).standard_normal(len(values))
    posterior = fitted(points, values, FitSettings(kernel, mean, additive, **QUICK))
    assert (posterior.hyperparameters.additive > 0) == additive
    model = gpy_model(posterior.hyperparameters, points, values, kernel)
    x = np.random.default_rng(2).random((20, 4))
    expected_mean, expected_variance = model.predict_noiseless(x)
    expected_mean_gradient, expected_variance_gradient = model.predictive_gradients(x)

    got_mean, got_std = posterior.predict(x)
    # GPy adds 1e-8 to the noise.
    np.testing.assert_allclose(got_mean, expected_mean, atol=1e-6)
    np.testing.assert_allclose(got_std**2, expected_variance[:, 0], atol=1e-6)
    for i, point in enumerate(x):
        one_mean, one_std, mean_gradient, std_gradient = posterior.predict_with_gradient(point)
        assert one_mean[0] == pytest.approx(got_mean[i, 0], abs=1e-12)
        assert one_std == pytest.approx(got_std[i], abs=1e-12)
        np.testing.assert_allclose(mean_gradient, expected_mean_gradient[i].T, rtol=1e-5, atol=3e-6)
        np.testing.assert_allclose(2 * one_std * std_gradient, expected_variance_gradient[i], rtol=1e-5, atol=3e-6)


@pytest.mark.parametrize("kernel", ["rbf", "matern52"])
def test_prediction_and_gradient_hold_at_a_data_point(kernel):
    points, values = data()
    posterior = fitted(points, values, FitSettings(kernel, **QUICK))
    mean, std, mean_gradient, _ = posterior.predict_with_gradient(points[3])
    assert mean[0] == pytest.approx(values[3], abs=0.02)
    assert std < 0.02
    step = 1e-5 * np.eye(4)
    numerical = (posterior.predict(points[3] + step)[0] - posterior.predict(points[3] - step)[0])[:, 0] / 2e-5
    np.testing.assert_allclose(mean_gradient[0], numerical, atol=1e-5)


@pytest.mark.parametrize("kernel", ["rbf", "matern52"])
def test_noise_of_each_point_and_several_worlds_are_textbook_regression(kernel):
    points, values = data(20, 3)
    noise = np.random.default_rng(1).uniform(1e-3, 0.5, 20)
    hyper = fit(points, values, FitSettings(kernel, screened=2, restarts=1), np.random.default_rng(0), noise)
    worlds = np.stack([values, values**2, -values], axis=1)
    posterior = condition(hyper, points, worlds, noise + hyper.noise)
    x = np.random.default_rng(2).random((6, 3))
    K = covariance_of(hyper, kernel, points, points) + np.diag(noise + hyper.noise)
    k = covariance_of(hyper, kernel, x, points)
    mean, std = posterior.predict(x)
    np.testing.assert_allclose(mean, hyper.mean + k @ np.linalg.solve(K, worlds - hyper.mean), atol=1e-7)
    variance = hyper.variance + hyper.additive - np.einsum("ij,ji->i", k, np.linalg.solve(K, k.T))
    np.testing.assert_allclose(std**2, variance, atol=1e-7)


def test_joint_draws_have_the_mean_and_covariance_that_gpy_predicts():
    points, values = data(10, 2)
    values = values + 0.3 * np.random.default_rng(1).standard_normal(10)
    posterior = fitted(points, values, FitSettings(noise=0.05, **QUICK))
    x = np.random.default_rng(2).random((5, 2))
    mean, covariance = gpy_model(posterior.hyperparameters, points, values, "matern52").predict_noiseless(
        x, full_cov=True
    )
    draws = posterior.sample(x, 40_000, np.random.default_rng(3))
    spread = np.sqrt(np.diag(covariance))
    assert np.all(np.abs(draws.mean(axis=1) - mean[:, 0]) < 5 * spread / 200)
    np.testing.assert_allclose(np.cov(draws), covariance, atol=0.04 * spread.max() ** 2)


def test_a_warped_process_is_a_plain_one_on_warped_points():
    points, _ = data(25, 2)
    values = standardised(np.log(0.01 + points).sum(axis=1))
    posterior = fitted(points, values, FitSettings(warp=True, noise=1e-3, **QUICK))
    hyper = posterior.hyperparameters

    def warped(x):
        # If X^a is Beta(1, b) distributed, X has Kumaraswamy's distribution.
        return np.stack([beta(1, b).cdf(x[:, i] ** a) for i, (a, b) in enumerate(zip(*ab, strict=True))], axis=1)

    ab = hyper.warp.a, hyper.warp.b
    model = gpy_model(hyper, warped(points), values, "matern52")
    x = np.random.default_rng(2).uniform(0.01, 0.99, (10, 2))
    mean, variance = model.predict_noiseless(warped(x))
    got_mean, got_std = posterior.predict(x)
    np.testing.assert_allclose(got_mean, mean, atol=1e-6)
    np.testing.assert_allclose(got_std**2, variance[:, 0], atol=1e-6)
    for point in x:
        _, _, by_mean, by_std = posterior.predict_with_gradient(point)
        expected = differences(lambda at: posterior.predict(at[None])[0][0, 0], point, 1e-4)
        np.testing.assert_allclose(by_mean[0], expected, rtol=1e-5, atol=1e-6)
        expected = differences(lambda at: posterior.predict(at[None])[1][0], point, 1e-4)
        np.testing.assert_allclose(by_std, expected, rtol=1e-4, atol=1e-6)
