"""Maximising a merit over the unit cube: many starts, then L-BFGS-B with exact gradients."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from .._quasirandom import sobol
from ._merit import Merit

# Two points closer than this in every coordinate of the unit cube count as one: asking both would teach nothing, and
# contradicting values at one place upset the fit.
SAME_POINT = 1e-4

_SOBOL_LOG2 = 10
_NEAR_EACH = 100
_STARTS_EACH = 8
_ITERATIONS = 60
_BISECTIONS = 12

Admissible = Callable[[NDArray], bool]


def maximise(
    merit: Merit,
    taken: NDArray,
    incumbents: NDArray,
    rng: np.random.Generator,
    admissible: Admissible,
) -> tuple[NDArray, float]:
    """Return the point (d,) of the unit cube where the merit is largest and nothing was asked yet, and its merit.

    Parameters
    ----------
    merit : Merit
    taken : ndarray (n, d)
        Points already asked.
    incumbents : ndarray (k, d)
        The best points told: starts are laid around them, too.
    rng : numpy.random.Generator
    admissible : callable
        Whether a point (d,) may be asked at all, known before any experiment.

    Raises
    ------
    ValueError
        None of a thousand points and more that were tried is admissible.
    """
    dimension = taken.shape[1]
    spread = sobol(dimension, _SOBOL_LOG2, rng)
    groups = [spread, _around(incumbents, rng)]
    values = [merit(group) for group in groups]
    largest = max(float(np.abs(value).max()) for value in values)
    # L-BFGS-B stops at absolute tolerances, and plain EI may be small everywhere.
    unit = largest if 0.0 < largest < 1.0 else 1.0

    def descend(x: NDArray) -> tuple[float, NDArray]:
        value, gradient = merit.with_gradient(x)
        return -value / unit, -gradient / unit

    found = []
    for group, value in zip(groups, values, strict=True):
        for start in group[np.argsort(-value, kind="stable")[:_STARTS_EACH]]:
            result = minimize(
                descend,
                start,
                jac=True,
                method="L-BFGS-B",
                bounds=[(0.0, 1.0)] * dimension,
                options={"maxiter": _ITERATIONS},
            )
            found.append((-result.fun * unit, result.x))
    scattered = list(zip(np.concatenate(values), np.concatenate(groups), strict=True))
    goal = max(found, key=lambda pair: pair[0])[1]
    for candidates in (found, scattered):
        for value, x in sorted(candidates, key=lambda pair: -pair[0]):
            if _is_new(x, taken) and admissible(x):
                if candidates is scattered:
                    x, value = _nearer(x, value, goal, merit, taken, admissible)
                return x, float(value)
    raise ValueError(
        f"none of {len(scattered)} points of the box keeps the conditions: widen the bounds, or loosen the conditions"
    )


def _is_new(x: NDArray, taken: NDArray) -> bool:
    return bool(np.abs(taken - x).max(axis=1).min() > SAME_POINT)


def _nearer(
    start: NDArray, value: float, goal: NDArray, merit: Merit, taken: NDArray, admissible: Admissible
) -> tuple[NDArray, float]:
    """The admissible point farthest on the way from an admissible start to the goal, if it is new and better."""
    low, high = 0.0, 1.0
    for _ in range(_BISECTIONS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if admissible(start + middle * (goal - start)) else (low, middle)
    border = start + low * (goal - start)
    there = float(merit(border[None, :])[0])
    return (border, there) if there > value and _is_new(border, taken) else (start, value)


def _around(incumbents: NDArray, rng: np.random.Generator) -> NDArray:
    """Points near the incumbents at all scales from 0.001 to 0.3 of the cube, some coordinates unmoved."""
    centres = np.repeat(incumbents, _NEAR_EACH, axis=0)
    scale = 10.0 ** rng.uniform(-3.0, -0.5, (len(centres), 1))
    moved = rng.random(centres.shape) < rng.uniform(0.2, 1.0, (len(centres), 1))
    return np.clip(centres + scale * moved * rng.standard_normal(centres.shape), 0.0, 1.0)
