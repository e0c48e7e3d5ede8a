"""Hyperparameters drawn from all that the data and the priors leave open, not only the most probable ones."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray

_BURN_IN = 8
_WIDTH = 1.0


def slice_sample(
    log_density: Callable[[NDArray], float],
    start: NDArray,
    bounds: NDArray,
    family: slice,
    count: int,
    rng: np.random.Generator,
) -> list[NDArray]:
    """Return points drawn from a density in a box, by slices along lines (Neal 2003, "Slice sampling").

    A point is a sweep from the one before: along each coordinate by itself, but for those of a family, which move all
    together and then along one direction among them. What moves them one by one is mostly of no consequence.

    Parameters
    ----------
    log_density : callable
        Of a point (k,), up to a constant.
    start : ndarray (k,)
        Where it is high.
    bounds : ndarray (k, 2)
        A coordinate whose bounds are equal stays there.
    family : slice
        Which coordinates belong together.
    count : int
        How many points.
    rng : numpy.random.Generator
    """
    at, drawn = np.clip(start, *bounds.T), []
    value = log_density(at)
    for sweep in range(_BURN_IN + count):
        for direction in _directions(bounds, family, rng):
            at, value = _along(log_density, at, value, direction, bounds, rng)
        if sweep >= _BURN_IN:
            drawn.append(at)
    return drawn


def _directions(bounds: NDArray, family: slice, rng: np.random.Generator) -> Iterator[NDArray]:
    free = bounds[:, 0] < bounds[:, 1]
    together = np.zeros(len(bounds), dtype=bool)
    together[family] = True
    for i in np.flatnonzero(free & ~together):
        yield np.eye(len(bounds))[i]
    if (free & together).any():
        yield (free & together).astype(float)
        among = np.where(free & together, rng.standard_normal(len(bounds)), 0.0)
        yield among / np.linalg.norm(among)


def _along(
    log_density: Callable[[NDArray], float],
    here: NDArray,
    value: float,
    direction: NDArray,
    bounds: NDArray,
    rng: np.random.Generator,
) -> tuple[NDArray, float]:
    """The next point on the line through `here`, and its log density."""
    level = value - rng.exponential()

    def above(t: float) -> bool:
        x = here + t * direction
        return bool(np.all((x >= bounds[:, 0]) & (x <= bounds[:, 1]))) and log_density(x) > level

    low = -_WIDTH * rng.random()
    high = low + _WIDTH
    while above(low):
        low -= _WIDTH
    while above(high):
        high += _WIDTH
    while not above(t := rng.uniform(low, high)):
        low, high = (t, high) if t < 0 else (low, t)
    there = here + t * direction
    return there, log_density(there)
