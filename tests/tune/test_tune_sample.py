"""Hyperparameters drawn from all that the data leave open."""

import numpy as np
import pytest
from scipy.stats import truncnorm

from socasadi.tune.surrogate import FitSettings, draw, fit
from socasadi.tune.surrogate._sample import slice_sample

WIDE = np.array([[-50.0, 50.0]] * 3)


@pytest.mark.parametrize("family", [slice(0, 0), slice(1, 3), slice(0, 3)])
def test_draws_from_a_normal_density_have_its_mean_and_covariance(family):
    mean = np.array([1.0, -2.0, 0.5])
    covariance = np.array([[1.0, 0.6, 0.0], [0.6, 2.0, -0.3], [0.0, -0.3, 0.25]])
    inverse = np.linalg.inv(covariance)

    def log_density(x):
        return -0.5 * (x - mean) @ inverse @ (x - mean)

    drawn = np.array(slice_sample(log_density, np.zeros(3), WIDE, family, 6000, np.random.default_rng(0)))
    np.testing.assert_allclose(drawn.mean(axis=0), mean, atol=0.12)
    np.testing.assert_allclose(np.cov(drawn.T), covariance, atol=0.2)


def test_draws_stay_in_the_box_and_are_distributed_as_the_density_is_there():
    bounds, rng = np.array([[0.5, 1.5]]), np.random.default_rng(0)
    drawn = np.array(slice_sample(lambda x: -0.5 * float(x @ x), np.array([9.0]), bounds, slice(0, 0), 4000, rng))
    assert np.all((drawn >= 0.5) & (drawn <= 1.5))
    expected = truncnorm(0.5, 1.5)
    assert abs(drawn.mean() - expected.mean()) < 0.02
    assert abs(drawn.std() - expected.std()) < 0.02


def test_a_coordinate_without_room_stays_and_holds_up_no_other():
    bounds = np.array([[0.0, 0.0], [-9.0, 9.0], [2.0, 2.0]])
    rng = np.random.default_rng(0)
    drawn = np.array(slice_sample(lambda x: -0.5 * x[1] ** 2, np.zeros(3), bounds, slice(1, 3), 4000, rng))
    assert np.all(drawn[:, [0, 2]] == [0.0, 2.0])
    assert abs(drawn[:, 1].std() - 1.0) < 0.05


@pytest.mark.slow
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
    assert spreads[1] < 0.3 < 0.6 < spreads[0]
