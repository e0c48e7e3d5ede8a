"""Merits of one point: expected improvement and its logarithm against numerical integration, the confidence bound."""

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import norm

from socasadi.tune.acquisition import (
    acquisition_named,
    confidence_bound,
    expected_improvement,
    log_expected_improvement,
)


def integral(mean, std, best):
    """E[max(best - f, 0)] for f ~ N(mean, std^2)."""
    low = mean - 40 * std
    return quad(lambda f: (best - f) * norm.pdf(f, mean, std), min(low, best), best, epsabs=0, epsrel=1e-11)[0]


def log_integral(z):
    """log of the integral of t phi(t - z) over t > 0, for z < 0, with t = s/|z| and the large factor taken out."""
    inside, _ = quad(lambda s: s * np.exp(-s - 0.5 * (s / z) ** 2), 0, 60, epsabs=0, epsrel=1e-12)
    return -0.5 * z * z - 0.5 * np.log(2 * np.pi) + np.log(inside) - 2 * np.log(-z)


@pytest.mark.parametrize("mean", [-1.0, 0.3, 2.0])
@pytest.mark.parametrize("std", [0.2, 1.0, 3.0])
def test_ei_is_the_mean_of_the_improvement_below_the_best(mean, std):
    value = expected_improvement(np.array([mean]), np.array([std]), 0.5)[0][0]
    expected = integral(mean, std, 0.5)
    assert value == pytest.approx(expected, rel=1e-8, abs=1e-14)
    assert log_expected_improvement(np.array([mean]), np.array([std]), 0.5)[0][0] == pytest.approx(
        np.log(expected), rel=1e-8
    )


def test_ei_is_what_a_million_draws_improve_on_average():
    draws = np.random.default_rng(0).normal(0.8, 0.6, 1_000_000)
    gains = np.maximum(0.5 - draws, 0.0)
    value = float(expected_improvement(np.array(0.8), np.array(0.6), 0.5)[0])
    assert value == pytest.approx(gains.mean(), abs=4 * gains.std() / 1000)


@pytest.mark.parametrize("z", [-0.5, -5.0, -30.0, -59.9, -60.1, -1e3, -1e5, -1e8])
def test_log_ei_is_accurate_where_ei_underflows(z):
    std = 0.7
    value = log_expected_improvement(np.array(-z * std), np.array(std), 0.0)[0]
    assert float(value) == pytest.approx(np.log(std) + log_integral(z), rel=1e-11)


def test_a_certain_improvement_is_the_difference_of_the_means():
    value, by_mean, by_std = log_expected_improvement(np.array(-100.0), np.array(1.0), 0.0)
    assert float(value) == pytest.approx(np.log(100.0), rel=1e-12)
    assert float(by_mean) == pytest.approx(-1 / 100.0, rel=1e-12)
    assert float(by_std) == pytest.approx(0.0, abs=1e-12)


FUNCTIONS = {"ei": expected_improvement, "log_ei": log_expected_improvement, "ucb": confidence_bound}


@pytest.mark.parametrize(
    ("name", "z"),
    [("log_ei", z) for z in (30.0, 2.0, 0.0, -1.0, -20.0, -59.0, -61.0, -1e3)]
    + [("ei", z) for z in (3.0, 0.0, -2.0)]
    + [("ucb", z) for z in (30.0, 3.0, 0.0, -2.0, -30.0)],
)
def test_derivatives_are_those_of_the_value(name, z):
    function, std, h = FUNCTIONS[name], 0.7, 1e-6 / max(1.0, abs(z))

    def value(mean, std):
        return function(np.array(mean), np.array(std), 0.0)[0]

    mean = -z * std
    _, by_mean, by_std = function(np.array(mean), np.array(std), 0.0)
    np.testing.assert_allclose(by_mean, (value(mean + h, std) - value(mean - h, std)) / (2 * h), rtol=2e-4, atol=1e-8)
    np.testing.assert_allclose(by_std, (value(mean, std + h) - value(mean, std - h)) / (2 * h), rtol=2e-4, atol=1e-8)


@pytest.mark.parametrize("name", ["log_ei", "ucb"])
def test_less_mean_or_more_deviation_is_always_preferred(name):
    z = np.linspace(-200, 20, 2001)
    std = np.full_like(z, 0.3)
    value, by_mean, by_std = FUNCTIONS[name](-z * std, std, 0.0)
    assert np.isfinite(value).all()
    assert np.all(np.diff(value) > 0)
    assert np.all(by_mean < 0)
    assert np.all(by_std >= 0)


def test_the_confidence_bound_orders_points_by_mean_less_two_deviations():
    rng = np.random.default_rng(0)
    mean, std = rng.normal(size=200), rng.uniform(0.01, 2.0, 200)
    merit = confidence_bound(mean, std, 0.3)[0]
    np.testing.assert_array_equal(np.argsort(-merit), np.argsort(mean - 2 * std))


def test_an_acquisition_that_is_not_known_is_refused_with_the_known_ones():
    with pytest.raises(ValueError, match="unknown acquisition 'pi'; known are 'log_ei', 'ei', 'noisy_ei', 'ucb'"):
        acquisition_named("pi")
