"""Data for Gaussian processes, and what the tests of them share."""

import numpy as np

from socasadi.tune.surrogate import FitSettings, condition, fit


def wave(x):
    """A smooth function of the first two coordinates only."""
    return np.sin(5 * x[:, 0]) + 1.5 * x[:, 1] ** 2


def standardised(values):
    return (values - values.mean()) / values.std()


def data(n=40, d=4, seed=0):
    points = np.random.default_rng(seed).random((n, d))
    return points, standardised(wave(points))


QUICK = {"screened": 8, "restarts": 1}  # where the fit is not what is claimed about


def fitted(points, values, settings=None):
    """The process fitted to the values."""
    hyper = fit(points, values, settings or FitSettings(**QUICK), np.random.default_rng(0))
    return condition(hyper, points, values[:, None], hyper.noise)


def covariance_of(hyper, kernel, x, z):
    """Rasmussen and Williams 2006, eqs. 4.9 and 4.17, of all coordinates and of each."""

    def of(r):
        s = np.sqrt(5) * r
        return np.exp(-0.5 * r**2) if kernel == "rbf" else (1 + s + s**2 / 3) * np.exp(-s)

    apart = (x[:, None] - z[None]) / hyper.lengthscales
    each = of(np.sqrt(x.shape[1]) * np.abs(apart)).mean(axis=2)
    return hyper.variance * of(np.linalg.norm(apart, axis=2)) + hyper.additive * each
