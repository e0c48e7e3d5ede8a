"""What a fitted search says of each entry of theta: how the cost changes with it, and where the best of it may lie."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri

from ._belief import Belief
from ._space import Space

_VALUES = 41
_CHANCES = (0.05, 0.5, 0.95)
_WIDE, _NEAR, _DRAWN = 512, 512, 256
"""Points over the whole box and about the best ones among which the best is looked for, and how often."""


@dataclass(frozen=True, eq=False)
class Sensitivity:
    """How the cost depends on the entries of theta, as far as a search knows.

    Attributes
    ----------
    theta
        (d,) through which the slices go.
    values
        (d, k) of each entry within its bounds, the other entries being those of ``theta``.
    low, middle, high
        (d, k) cost without noise there: the 5, 50 and 95 % quantiles.
    relevance
        (d,) shares, which add up to 1, of the reciprocal lengthscales: how quickly the cost changes with an entry
        (automatic relevance determination).
    likely
        (d, 2) between which values an entry of the best theta lies with 90 %: the least of each of 256 functions that
        the told trials allow, among a thousand points.
    """

    theta: NDArray
    values: NDArray
    low: NDArray
    middle: NDArray
    high: NDArray
    relevance: NDArray
    likely: NDArray


def sensitivity(belief: Belief, space: Space, theta: NDArray, seed: int) -> Sensitivity:
    """Of the fitted process about ``theta``; the same for the same belief."""
    d, process = space.dimension, belief.cost
    centre, steps = space.to_unit(theta), np.linspace(0.0, 1.0, _VALUES)
    slices = np.tile(centre, (d, _VALUES, 1))
    slices[np.arange(d), :, np.arange(d)] = steps
    mean, deviation = process.predict(slices.reshape(-1, d))
    at_chance = (mean[:, 0] + z * deviation for z in ndtri(_CHANCES))
    low, middle, high = (belief.data.restore(target).reshape(d, _VALUES) for target in at_chance)
    inverse = 1 / process.hyperparameters.lengthscales
    return Sensitivity(
        theta=theta,
        values=np.array([[space.from_unit(point)[i] for point in slices[i]] for i in range(d)]),
        low=low,
        middle=middle,
        high=high,
        relevance=inverse / inverse.sum(),
        likely=_likely(belief, space, np.random.default_rng([seed, len(belief.trials), 6])),
    )


def _likely(belief: Belief, space: Space, rng: np.random.Generator) -> NDArray:
    """(d, 2)"""
    process, d = belief.cost, space.dimension
    order = np.argsort(belief.data.targets)
    best = belief.data.points[order[: max(len(order) // 5, 1)]]
    spread = 0.3 * np.minimum(process.hyperparameters.lengthscales, 1.0)
    near = best[rng.integers(len(best), size=_NEAR)] + spread * rng.standard_normal((_NEAR, d))
    points = np.vstack([best, rng.random((_WIDE, d)), np.clip(near, 0.0, 1.0)])
    drawn = process.sample(points, _DRAWN, rng)
    ends = np.quantile(points[drawn.argmin(axis=0)], _CHANCES[::2], axis=0)
    return np.array([space.from_unit(end) for end in ends]).T
