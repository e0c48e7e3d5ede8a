"""The Gaussian process: closed-form prediction, maximum marginal likelihood, and what GPy does to the unwary."""

import subprocess
import sys

import numpy as np
import pytest
from scipy.stats import lognorm, multivariate_normal

from socasadi.tune import FitSettings, fit


def wave(x):
    """A smooth function of the first two coordinates only."""
    return np.sin(5 * x[:, 0]) + 1.5 * x[:, 1] ** 2


def standardised(values):
    return (values - values.mean()) / values.std()


def data(n=40, d=4, seed=0):
    points = np.random.default_rng(seed).random((n, d))
    return points, standardised(wave(points))


def gpy_model(posterior, points, values, kernel):
    """GPy's own model at the hyperparameters of a posterior."""
    import GPy

    hyper = posterior.hyperparameters
    d = points.shape[1]
    kern = {"rbf": GPy.kern.RBF, "matern52": GPy.kern.Matern52}[kernel](
        d, variance=hyper.variance, lengthscale=hyper.lengthscales, ARD=True
    )
    likelihood = GPy.likelihoods.Gaussian(variance=hyper.noise)
    mean = GPy.mappings.Constant(d, 1, value=hyper.mean)
    return GPy.core.GP(points, values[:, None], kern, likelihood, mean_function=mean)


@pytest.mark.parametrize("kernel", ["rbf", "matern52"])
@pytest.mark.parametrize("mean", ["constant", "zero"])
def test_closed_form_prediction_and_gradients_agree_with_gpy(kernel, mean):
    points, values = data()
    values = values + 0.1 * np.random.default_rng(1).standard_normal(len(values))
    posterior = fit(points, values, FitSettings(kernel, mean), np.random.default_rng(0))
    model = gpy_model(posterior, points, values, kernel)
    x = np.random.default_rng(2).random((20, 4))
    expected_mean, expected_variance = model.predict_noiseless(x)
    expected_mean_gradient, expected_variance_gradient = model.predictive_gradients(x)

    got_mean, got_std = posterior.predict(x)
    np.testing.assert_allclose(got_mean, expected_mean[:, 0], atol=1e-8)
    np.testing.assert_allclose(got_std**2, expected_variance[:, 0], atol=1e-8)
    for i, point in enumerate(x):
        one_mean, one_std, mean_gradient, std_gradient = posterior.predict_with_gradient(point)
        assert one_mean == pytest.approx(got_mean[i], abs=1e-12)
        assert one_std == pytest.approx(got_std[i], abs=1e-12)
        np.testing.assert_allclose(mean_gradient, expected_mean_gradient[i, :, 0], atol=1e-8)
        np.testing.assert_allclose(2 * one_std * std_gradient, expected_variance_gradient[i], atol=1e-8)


@pytest.mark.parametrize("kernel", ["rbf", "matern52"])
def test_prediction_and_gradient_hold_at_a_data_point(kernel):
    points, values = data()
    posterior = fit(points, values, FitSettings(kernel), np.random.default_rng(0))
    mean, std, mean_gradient, _ = posterior.predict_with_gradient(points[3])
    assert mean == pytest.approx(values[3], abs=0.02)
    assert std < 0.02
    step = 1e-5 * np.eye(4)
    numerical = (posterior.predict(points[3] + step)[0] - posterior.predict(points[3] - step)[0]) / 2e-5
    np.testing.assert_allclose(mean_gradient, numerical, atol=1e-5)


def log_posterior(points, values, kernel, mean, variance, lengthscales, noise, priors):
    """Marginal likelihood from scipy's multivariate normal, and BoTorch's documented lengthscale prior."""
    r = np.linalg.norm((points[:, None] - points[None]) / lengthscales, axis=2)
    s = np.sqrt(5) * r
    k = np.exp(-0.5 * r**2) if kernel == "rbf" else (1 + s + s**2 / 3) * np.exp(-s)
    covariance = variance * k + (noise + 1e-8) * np.eye(len(points))
    value = multivariate_normal.logpdf(values, np.full(len(values), mean), covariance)
    if priors:
        scale = np.exp(np.sqrt(2) + 0.5 * np.log(points.shape[1]))
        value += lognorm.logpdf(lengthscales, s=np.sqrt(3), scale=scale).sum()
    return value


@pytest.mark.parametrize(("kernel", "priors"), [("rbf", False), ("matern52", True)])
def test_no_other_hyperparameters_are_more_likely(kernel, priors):
    points, values = data(30, 3)
    values = standardised(values + 0.2 * np.random.default_rng(3).standard_normal(30))
    hyper = fit(points, values, FitSettings(kernel, priors=priors), np.random.default_rng(0)).hyperparameters
    found = np.array([hyper.mean, hyper.variance, *hyper.lengthscales, hyper.noise])

    def at(h):
        return log_posterior(points, values, kernel, h[0], h[1], h[2:5], h[5], priors)

    rng = np.random.default_rng(4)
    best = at(found)
    for size in (0.01, 0.1, 1.0):
        for _ in range(60):
            change = size * rng.standard_normal(6)
            other = np.array([found[0] + change[0], *(found[1:] * np.exp(change[1:]))])
            other[2:5] = np.minimum(other[2:5], 1e3)
            assert at(other) <= best + 1e-3


def test_an_irrelevant_dimension_gets_a_long_lengthscale():
    points, values = data(60, 4)
    for kernel in ("rbf", "matern52"):
        for priors in (True, False):
            settings = FitSettings(kernel, priors=priors)
            scales = fit(points, values, settings, np.random.default_rng(0)).hyperparameters.lengthscales
            assert scales[0] < scales[1] < scales[2:].min()
            assert scales[2:].min() > 3 * scales[0]


def test_fitted_noise_is_the_noise_that_was_added():
    points = np.random.default_rng(0).random((120, 2))
    values = standardised(wave(points)) + 0.3 * np.random.default_rng(1).standard_normal(120)
    hyper = fit(points, values, FitSettings(), np.random.default_rng(0)).hyperparameters
    assert np.sqrt(hyper.noise) == pytest.approx(0.3, rel=0.2)


def test_fixed_noise_stays_fixed_and_zero_mean_stays_zero():
    hyper = fit(*data(), FitSettings("rbf", "zero", False, 1e-4), np.random.default_rng(0)).hyperparameters
    assert hyper.noise == pytest.approx(1e-4, rel=1e-12)
    assert hyper.mean == 0.0


def test_smooth_data_do_not_drive_the_noise_to_nothing():
    hyper = fit(*data(80, 2), FitSettings(priors=False), np.random.default_rng(0)).hyperparameters
    assert 1e-6 * (1 - 1e-9) <= hyper.noise < 1e-3


def test_constant_targets_leave_a_usable_process():
    posterior = fit(data()[0], np.zeros(40), FitSettings(), np.random.default_rng(0))
    mean, std = posterior.predict(np.random.default_rng(1).random((5, 4)))
    np.testing.assert_allclose(mean, 0.0, atol=1e-6)
    assert np.all(std > 1e-6)


def test_contradicting_values_at_one_point_are_averaged():
    points, values = data(30, 2)
    points, values = np.vstack([points, points[0], points[0]]), np.append(values, values[0] + [0.5, -0.5])
    posterior = fit(points, values, FitSettings(noise=1e-4), np.random.default_rng(0))
    assert posterior.hyperparameters.variance > 0.01
    assert posterior.predict(points[:1])[0][0] == pytest.approx(values[0], abs=0.05)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_what_is_not_finite_never_reaches_gpy(bad):
    points, values = data()
    with pytest.raises(ValueError, match="not finite"):
        fit(points, np.where(np.arange(40) == 7, bad, values), FitSettings(), np.random.default_rng(0))
    points[3, 2] = bad
    with pytest.raises(ValueError, match="not finite"):
        fit(points, values, FitSettings(), np.random.default_rng(0))


def test_the_fit_keeps_no_hold_of_the_callers_arrays():
    points, values = data()
    posterior = fit(points, values, FitSettings(), np.random.default_rng(0))
    x = np.full((1, 4), 0.3)
    before = posterior.predict(x)
    points[:] = 0.0
    values[:] = 0.0
    np.testing.assert_array_equal(posterior.predict(x), before)


def test_the_fit_neither_reads_nor_moves_the_global_random_state():
    np.random.seed(1)  # noqa: NPY002
    first = fit(*data(), FitSettings(), np.random.default_rng(0)).hyperparameters
    state = np.random.get_state()[1].copy()  # noqa: NPY002
    np.random.seed(2)  # noqa: NPY002
    second = fit(*data(), FitSettings(), np.random.default_rng(0)).hyperparameters
    np.testing.assert_array_equal(first.lengthscales, second.lengthscales)
    np.random.seed(1)  # noqa: NPY002
    np.testing.assert_array_equal(np.random.get_state()[1], state)  # noqa: NPY002


def test_gpy_comes_late_and_leaves_the_warning_filters_and_error_state_alone():
    code = """
import sys, warnings, logging
import numpy as np
from socasadi.tune import FitSettings, fit
assert "GPy" not in sys.modules, "GPy was imported before it was needed"
before, errors, level = list(warnings.filters), np.geterr(), logging.getLogger().level
fit(np.random.default_rng(0).random((8, 2)), np.arange(8.0), FitSettings(), np.random.default_rng(0))
assert "GPy" in sys.modules
assert list(warnings.filters) == before, "the warning filters changed"
assert np.geterr() == errors and logging.getLogger().level == level
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout == ""


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ({"kernel": "cubic"}, "unknown kernel 'cubic'; known are 'matern52', 'rbf'"),
        ({"mean": "linear"}, "unknown mean 'linear'; known are 'constant', 'zero'"),
        ({"noise": 0.0}, "noise is 0.0"),
        ({"noise": "small"}, "noise is 'small'"),
        ({"noise": np.nan}, "noise is nan"),
    ],
)
def test_a_setting_that_is_not_known_is_refused(settings, said):
    with pytest.raises(ValueError, match=said):
        FitSettings(**settings)
