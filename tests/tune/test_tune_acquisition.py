"""Expected improvement and its logarithm against numerical integration."""

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import norm

from socasadi.tune import expected_improvement, log_expected_improvement


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


@pytest.mark.parametrize("z", [30.0, 2.0, 0.0, -1.0, -20.0, -59.0, -61.0, -1e3])
def test_derivatives_of_log_ei_are_those_of_its_value(z):
    std = 0.7
    h = 1e-6 / max(1.0, abs(z))

    def value(mean, std):
        return log_expected_improvement(np.array(mean), np.array(std), 0.0)[0]

    _, by_mean, by_std = log_expected_improvement(np.array(-z * std), np.array(std), 0.0)
    mean = -z * std
    np.testing.assert_allclose(by_mean, (value(mean + h, std) - value(mean - h, std)) / (2 * h), rtol=2e-4, atol=1e-8)
    np.testing.assert_allclose(by_std, (value(mean, std + h) - value(mean, std - h)) / (2 * h), rtol=2e-4, atol=1e-8)


@pytest.mark.parametrize("z", [3.0, 0.0, -2.0])
def test_derivatives_of_ei_are_those_of_its_value(z):
    std, h = 0.7, 1e-6
    mean = -z * std
    _, by_mean, by_std = expected_improvement(np.array(mean), np.array(std), 0.0)
    numerical_mean = (
        expected_improvement(np.array(mean + h), np.array(std), 0.0)[0]
        - expected_improvement(np.array(mean - h), np.array(std), 0.0)[0]
    ) / (2 * h)
    numerical_std = (
        expected_improvement(np.array(mean), np.array(std + h), 0.0)[0]
        - expected_improvement(np.array(mean), np.array(std - h), 0.0)[0]
    ) / (2 * h)
    np.testing.assert_allclose([by_mean, by_std], [numerical_mean, numerical_std], rtol=1e-6, atol=1e-9)


def test_less_mean_or_more_deviation_is_always_preferred():
    z = np.linspace(-200, 20, 2001)
    std = np.full_like(z, 0.3)
    value, by_mean, by_std = log_expected_improvement(-z * std, std, 0.0)
    assert np.all(np.diff(value) > 0)
    assert np.all(by_mean < 0)
    assert np.all(by_std >= 0)
