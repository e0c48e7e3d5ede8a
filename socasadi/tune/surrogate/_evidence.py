"""The marginal likelihood of kernel hyperparameters, by GPy, and its maximisation.

GPy gives the value and its derivative by the kernel matrix. Its own kernels and optimiser are not used: they cost
several times its likelihood, its restarts draw from numpy's global random state, and its parameters have no box. Here
every hyperparameter but the mean is a logarithm in a box.
"""

from __future__ import annotations

import functools
import warnings
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from ._kernel import kernel_named, kernel_parts

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
    """The kernel matrix of points (n, d), as a function of the logarithms of its hyperparameters.

    `logs` are those of variance, lengthscales (d), and, where the kernel has a sum, of the sum's variance.
    """

    def __init__(self, kernel: str, points: NDArray, additive: bool = False) -> None:
        self._shape, self._points, self._additive = kernel_named(kernel), points, additive
        self._pairs = np.triu_indices(len(points), 1)
        self._apart = points[self._pairs[0]] - points[self._pairs[1]]

    def __call__(self, logs: NDArray) -> NDArray:
        """The matrix (n, n)."""
        d = self._points.shape[1]
        self._variance, self._scales = float(np.exp(logs[0])), np.exp(logs[1 : d + 1])
        self._sum = float(np.exp(logs[d + 1])) if self._additive else 0.0
        self._scaled = self._apart / self._scales
        self._joint, self._each, self._slopes = kernel_parts(self._shape, self._scaled, self._variance, self._sum)
        K = np.empty(2 * (len(self._points),))
        K[self._pairs] = K.T[self._pairs] = self._joint + self._each
        np.fill_diagonal(K, self._variance + self._sum)
        return K

    def gradient(self, by_K: NDArray) -> NDArray:
        """Chain the derivative by the matrix (n, n) to one by the logarithms of the last call."""
        by_pair, by_diagonal = by_K[self._pairs] + by_K.T[self._pairs], float(np.trace(by_K))
        by_scales = by_pair @ (self._slopes * np.square(self._scaled))
        by_variance = by_pair @ self._joint + by_diagonal * self._variance
        by_sum = [by_pair @ self._each + by_diagonal * self._sum] if self._additive else []
        return np.array([by_variance, *by_scales, *by_sum])

    def gradient_of_points(self, by_K: NDArray) -> NDArray:
        """Chain it to one by the points (n, d)."""
        by_pair = by_K[self._pairs] + by_K.T[self._pairs]
        pulls = by_pair[:, None] * self._slopes * self._scaled / self._scales
        by_points = np.zeros_like(self._points)
        np.subtract.at(by_points, self._pairs[0], pulls)
        np.add.at(by_points, self._pairs[1], pulls)
        return by_points


def kernel_bounds(dimension: int, additive: bool = False) -> NDArray:
    """Bounds (1 + d [+ 1], 2) of a kernel matrix's logarithms."""
    return np.log([VARIANCE_BOUNDS] + [LENGTHSCALE_BOUNDS] * dimension + [VARIANCE_BOUNDS] * additive)


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
