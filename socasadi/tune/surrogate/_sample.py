"""Hyperparameters drawn from all that the data and the priors leave open, not only the most probable ones."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

_STEPS_EACH = 5
_WIDTH = 1.0


def slice_sample(
    log_density: Callable[[NDArray], float], start: NDArray, bounds: NDArray, count: int, rng: np.random.Generator
) -> list[NDArray]:
    """Return points drawn from a density in a box, by slices along random directions (Neal 2003, "Slice sampling").

    Parameters
    ----------
    log_density : callable
        Of a point (k,), up to a constant; minus infinity where there is none.
    start : ndarray (k,)
        Where it is high.
    bounds : ndarray (k, 2)
    count : int
        How many points; each is a few steps from the one before.
    rng : numpy.random.Generator
    """
    at, drawn = np.clip(start, *bounds.T), []
    value = log_density(at)
    for step in range(count * _STEPS_EACH):
        direction = rng.standard_normal(len(at))
        direction /= np.linalg.norm(direction)
        level, here = value - rng.exponential(), at

        def along(t: float, here: NDArray = here, direction: NDArray = direction) -> tuple[NDArray, float]:
            x = here + t * direction
            inside = bool(np.all((x >= bounds[:, 0]) & (x <= bounds[:, 1])))
            return x, log_density(x) if inside else -np.inf

        low = -_WIDTH * rng.random()
        high = low + _WIDTH
        while along(low)[1] > level:
            low -= _WIDTH
        while along(high)[1] > level:
            high += _WIDTH
        while True:
            t = rng.uniform(low, high)
            at, value = along(t)
            if value > level:
                break
            low, high = (t, high) if t < 0 else (low, t)
        if step % _STEPS_EACH == _STEPS_EACH - 1:
            drawn.append(at)
    return drawn
