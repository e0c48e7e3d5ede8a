"""The marginal likelihood of kernel hyperparameters, by GPy, and its maximisation.

GPy gives the value and its gradient. Its own optimiser is not used: it costs several times its likelihood, its
restarts draw from numpy's global random state, and its parameters have no box. Here every hyperparameter but the mean
is a logarithm in a box.
"""

from __future__ import annotations

import functools
import warnings
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from ._kernel import kernel_named, lengthscale_prior

# In the unit cube and for standardised targets. Without these boxes smooth data drive the noise to 1e-35 and constant
# targets the variance to 1e-10.
VARIANCE_BOUNDS = (1e-2, 1e2)
LENGTHSCALE_BOUNDS = (1e-2, 1e3)


@functools.cache
def import_gpy() -> Any:
    """Import GPy when it is first needed: it takes seconds, and resets the process's warning filters."""
    with warnings.catch_warnings():
        import GPy
    return GPy


class KernelMatrix:
    """GPy's kernel of that name, free of its transformations: the logarithms here ensure positivity."""

    def __init__(self, name: str, dimension: int) -> None:
        self.kernel = getattr(import_gpy().kern, kernel_named(name).gpy)(dimension, ARD=True)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            self.kernel.unconstrain()

    def set(self, logs: NDArray) -> None:
        """Take log variance and log lengthscales (1 + d,)."""
        self.kernel[:] = np.exp(logs)

    def gradient(self, by_K: NDArray, points: NDArray) -> NDArray:
        """Chain the derivative by the kernel matrix (n, n) to one by the logarithms (1 + d,)."""
        self.kernel.update_gradients_full(by_K, points)
        return self.kernel.gradient * self.kernel.param_array

    def gradient_of_points(self, by_K: NDArray, points: NDArray) -> NDArray:
        """Chain it to one by the points (n, d)."""
        return self.kernel.gradients_X(by_K, points)


def kernel_bounds(dimension: int) -> NDArray:
    """Bounds (1 + d, 2) of log variance and log lengthscales."""
    return np.log([VARIANCE_BOUNDS] + [LENGTHSCALE_BOUNDS] * dimension)


def lengthscale_penalty(logs: NDArray) -> tuple[float, NDArray]:
    """Minus the log prior density of lengthscales, with its gradient by their logarithms `logs` (d,)."""
    mean, deviation = lengthscale_prior(len(logs))
    standard = (logs - mean) / deviation
    # The density of the lengthscale itself, not of its logarithm: hence the second term.
    return float(0.5 * standard @ standard + logs.sum()), standard / deviation + 1.0


def descend(
    loss: Callable[[NDArray], tuple[float, NDArray]],
    starts: Sequence[NDArray],
    bounds: NDArray,
    iterations: int = 100,
) -> NDArray:
    """Return the best of the minima that L-BFGS-B reaches from the starts."""
    results = [
        minimize(
            loss,
            np.clip(start, *bounds.T),
            jac=True,
            method="L-BFGS-B",
            bounds=bounds,
            options={"maxiter": iterations, "ftol": 1e-7, "gtol": 1e-3},
        )
        for start in starts
    ]
    return min(results, key=lambda result: result.fun).x
