"""The fitted Gaussian process: prediction in closed form."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.distance import cdist

from ._kernel import kernel_named


@dataclass(frozen=True, eq=False)
class Hyperparameters:
    """What a fit finds, in the unit cube and for standardised targets.

    `mean` is the constant mean, `variance` the kernel's, `noise` the variance of the observation noise,
    `lengthscales` (d,).
    """

    mean: float
    variance: float
    noise: float
    lengthscales: NDArray


@dataclass(frozen=True, eq=False)
class Posterior:
    """p(f | data) of an exact Gaussian process; f is the cost without its noise.

    With K the kernel matrix, W = K + noise I = L L' and alpha = W^-1 (y - mean):
    mean(x) = mean + k(x)' alpha, variance(x) = k(x, x) - |L^-1 k(x)|^2 (Rasmussen and Williams 2006, eq.
    2.25-26).

    Parameters
    ----------
    kernel : str
    hyperparameters : Hyperparameters
    points : ndarray (n, d)
        In the unit cube.
    alpha : ndarray (n,)
        The Woodbury vector.
    inverse_factor : ndarray (n, n)
        L^-1, lower triangular.
    """

    kernel: str
    hyperparameters: Hyperparameters
    points: NDArray = field(repr=False)
    alpha: NDArray = field(repr=False)
    inverse_factor: NDArray = field(repr=False)

    def predict(self, x: NDArray) -> tuple[NDArray, NDArray]:
        """Return mean and standard deviation, both (m,), at points x (m, d) of the unit cube."""
        hyper = self.hyperparameters
        squared = cdist(x / hyper.lengthscales, self.points / hyper.lengthscales, "sqeuclidean")
        k = hyper.variance * kernel_named(self.kernel).shape(squared)[0]
        reduction = np.square(k @ self.inverse_factor.T).sum(axis=1)
        return hyper.mean + k @ self.alpha, np.sqrt(np.maximum(hyper.variance - reduction, self._floor))

    def predict_with_gradient(self, x: NDArray) -> tuple[float, float, NDArray, NDArray]:
        """Return mean, standard deviation, and their gradients (d,) at one point x (d,) of the unit cube."""
        hyper = self.hyperparameters
        step = (x - self.points) / hyper.lengthscales
        k, slope = kernel_named(self.kernel).shape(np.einsum("ij,ij->i", step, step))
        k = hyper.variance * k
        slope = -hyper.variance * slope
        half = self.inverse_factor @ k
        variance = hyper.variance - half @ half
        mean = hyper.mean + k @ self.alpha
        # dk_i/dx = slope_i (x - x_i) / l^2, so both gradients are one product with `step`.
        weights = np.stack((self.alpha, half @ self.inverse_factor)) * slope
        mean_gradient, reduction_gradient = (weights @ step) / hyper.lengthscales
        if variance <= self._floor:
            return float(mean), float(np.sqrt(self._floor)), mean_gradient, np.zeros_like(x)
        std = float(np.sqrt(variance))
        return float(mean), std, mean_gradient, -reduction_gradient / std

    @property
    def _floor(self) -> float:
        # Below this the difference of k(x, x) and its reduction is rounding error.
        return 1e-13 * self.hyperparameters.variance
