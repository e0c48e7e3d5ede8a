"""Maximising an acquisition over the unit cube: many starts, then L-BFGS-B with exact gradients."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.stats import qmc

from ._acquisition import Acquisition
from ._posterior import Posterior

# Two points closer than this in every coordinate of the unit cube count as one: asking both would teach
# nothing, and contradicting values at one place upset the fit.
SAME_POINT = 1e-4

_SOBOL_LOG2 = 10
_NEAR_EACH = 100
_STARTS_EACH = 8
_ITERATIONS = 60


def maximise(
    acquisition: Acquisition,
    posterior: Posterior,
    best: float,
    incumbents: NDArray,
    rng: np.random.Generator,
) -> NDArray:
    """Return the point (d,) of the unit cube where the acquisition is largest and nothing was evaluated yet.

    Parameters
    ----------
    acquisition : Acquisition
    posterior : Posterior
        Its points are those already evaluated.
    best : float
        J* on the posterior's scale.
    incumbents : ndarray (k, d)
        The best evaluated points: starts are laid around them too.
    rng : numpy.random.Generator
    """
    dimension = posterior.points.shape[1]
    spread = qmc.Sobol(dimension, rng=rng).random_base2(_SOBOL_LOG2)
    groups = [spread, _around(incumbents, rng)]
    starts, fallback = [], []
    largest = 0.0
    for group in groups:
        value = acquisition(*posterior.predict(group), best)[0]
        order = np.argsort(-value, kind="stable")
        starts.extend(group[order[:_STARTS_EACH]])
        fallback.extend(zip(value, group, strict=True))
        largest = max(largest, float(np.abs(value).max()))
    # L-BFGS-B stops at absolute tolerances, and plain EI may be small everywhere.
    unit = largest if 0.0 < largest < 1.0 else 1.0

    def descend(x: NDArray) -> tuple[float, NDArray]:
        mean, std, mean_gradient, std_gradient = posterior.predict_with_gradient(x)
        value, by_mean, by_std = acquisition(np.asarray(mean), np.asarray(std), best)
        return -float(value) / unit, -(by_mean * mean_gradient + by_std * std_gradient) / unit

    found = []
    for start in starts:
        result = minimize(
            descend,
            start,
            jac=True,
            method="L-BFGS-B",
            bounds=[(0.0, 1.0)] * dimension,
            options={"maxiter": _ITERATIONS},
        )
        found.append((-result.fun, result.x))
    for candidates in (found, fallback):
        for _, x in sorted(candidates, key=lambda pair: -pair[0]):
            if np.abs(posterior.points - x).max(axis=1).min() > SAME_POINT:
                return x
    return spread[0]


def _around(incumbents: NDArray, rng: np.random.Generator) -> NDArray:
    """Points near the incumbents at all scales from 0.001 to 0.3 of the cube, some coordinates unmoved."""
    centres = np.repeat(incumbents, _NEAR_EACH, axis=0)
    scale = 10.0 ** rng.uniform(-3.0, -0.5, (len(centres), 1))
    moved = rng.random(centres.shape) < rng.uniform(0.2, 1.0, (len(centres), 1))
    return np.clip(centres + scale * moved * rng.standard_normal(centres.shape), 0.0, 1.0)
