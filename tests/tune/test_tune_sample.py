"""Hyperparameters drawn from all that the data leave open."""

import numpy as np
from scipy.stats import truncnorm

from socasadi.tune.surrogate import FitSettings, draw, fit
from socasadi.tune.surrogate._sample import slice_sample

WIDE = np.array([[-50.0, 50.0]] * 3)


def test_draws_from_a_normal_density_have_its_mean_and_covariance():
    mean = np.array([1.0, -2.0, 0.5])
    covariance = np.array([[1.0, 0.6, 0.0], [0.6, 2.0, -0.3], [0.0, -0.3, 0.25]])
    inverse = np.linalg.inv(covariance)

    def log_density(x):
        return -0.5 * (x - mean) @ inverse @ (x - mean)

    drawn = np.array(slice_sample(log_density, np.zeros(3), WIDE, 6000, np.random.default_rng(0)))
    np.testing.assert_allclose(drawn.mean(axis=0), mean, atol=0.12)
    np.testing.assert_allclose(np.cov(drawn.T), covariance, atol=0.2)


def test_draws_stay_in_the_box_and_are_distributed_as_the_density_is_there():
    bounds = np.array([[0.5, 1.5]])
    drawn = np.array(
        slice_sample(lambda x: -0.5 * float(x @ x), np.array([9.0]), bounds, 4000, np.random.default_rng(0))
    )
    assert np.all((drawn >= 0.5) & (drawn <= 1.5))
    expected = truncnorm(0.5, 1.5)
    assert abs(drawn.mean() - expected.mean()) < 0.02
    assert abs(drawn.std() - expected.std()) < 0.02


def test_what_eight_data_leave_open_is_wide_and_what_a_hundred_leave_is_not():
    spreads = []
    for n in (8, 120):
        rng = np.random.default_rng(1)
        points = rng.random((n, 2))
        values = np.sin(5 * points[:, 0]) + 0.3 * rng.standard_normal(n)
        values = (values - values.mean()) / values.std()
        settings, known = FitSettings(screened=8, restarts=1), np.zeros(n)
        fitted = fit(points, values, settings, rng)
        drawn = draw(points, values, settings, rng, known, fitted, 40)
        spreads.append(np.std([np.log(hyper.noise) for hyper in drawn]))
    assert spreads[1] < 0.3 < 0.9 < spreads[0]
