"""The fitted Gaussian process: conditioning on data, and prediction in closed form."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._kernel import kernel_matrix, kernel_named, kernel_parts
from ._warp import Warp


@dataclass(frozen=True, eq=False)
class Hyperparameters:
    """What a fit finds, in the unit cube and for standardised targets.

    `mean` is the constant mean, `variance` that of the kernel of all coordinates, `noise` the variance of the
    observation noise, `lengthscales` (d,), `additive` the variance of the sum of one-dimensional kernels, 0 without
    one; `warp` is None where the inputs are not warped; `common` is the variance of a constant that all points share (a
    mean that is not known).
    """

    kernel: str
    mean: float
    variance: float
    noise: float
    lengthscales: NDArray
    additive: float = 0.0
    warp: Warp | None = None
    common: float = 0.0

    @property
    def prior_variance(self) -> float:
        """Variance of the process before any data."""
        return self.variance + self.additive + self.common

    def scaled(self, x: NDArray) -> NDArray:
        """Points of the unit cube, warped and in lengthscales."""
        return (x if self.warp is None else self.warp(x)) / self.lengthscales

    def covariance(self, x: NDArray, z: NDArray) -> NDArray:
        """The kernel matrix (m, k) of points x (m, d) and z (k, d)."""
        shape = kernel_named(self.kernel)
        return kernel_matrix(shape, self.scaled(x), self.scaled(z), self.variance, self.additive) + self.common


@dataclass(frozen=True, eq=False)
class Posterior:
    """p(f | data) of an exact Gaussian process; f is the target without its noise.

    With K the kernel matrix, W = K + noise and alpha = W^-1 (y - mean): mean(x) = mean + k(x)' alpha,
    variance(x) = k(x, x) - |F k(x)|^2 with F' F = W^-1 (Rasmussen and Williams 2006, eq. 2.25-26).

    The data may have been sampled: then there are several *worlds*, which differ in their targets and so in alpha,
    at the same points. A process that saw nothing but measurements has one.

    Parameters
    ----------
    hyperparameters : Hyperparameters
    points : ndarray (n, d)
        In the unit cube.
    alpha : ndarray (n, w)
        One column a world.
    root : ndarray (n, n)
        F.
    """

    hyperparameters: Hyperparameters
    points: NDArray = field(repr=False)
    alpha: NDArray = field(repr=False)
    root: NDArray = field(repr=False)
    _scaled: NDArray = field(init=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "_scaled", self.hyperparameters.scaled(self.points))

    def predict(self, x: NDArray) -> tuple[NDArray, NDArray]:
        """Return the means (m, w) and the standard deviation (m,), which all worlds share, at x (m, d)."""
        hyper = self.hyperparameters
        k = hyper.covariance(x, self.points)
        reduction = np.square(k @ self.root.T).sum(axis=1)
        return hyper.mean + k @ self.alpha, np.sqrt(np.maximum(hyper.prior_variance - reduction, self._floor))

    def predict_with_gradient(self, x: NDArray) -> tuple[NDArray, float, NDArray, NDArray]:
        """Return means (w,), standard deviation, and their gradients (w, d) and (d,) at one point x (d,)."""
        hyper = self.hyperparameters
        step = hyper.scaled(x) - self._scaled
        joint, each, slopes = kernel_parts(kernel_named(hyper.kernel), step, hyper.variance, hyper.additive)
        k = joint + each + hyper.common
        half = self.root @ k
        variance = hyper.prior_variance - half @ half
        gradients = -np.vstack((self.alpha.T, half @ self.root)) @ (slopes * step) / hyper.lengthscales
        if hyper.warp is not None:
            gradients *= hyper.warp.slope(x)
        means = hyper.mean + k @ self.alpha
        if variance <= self._floor:
            return means, float(np.sqrt(self._floor)), gradients[:-1], np.zeros_like(x)
        std = float(np.sqrt(variance))
        return means, std, gradients[:-1], -gradients[-1] / std

    def sample(self, x: NDArray, count: int, rng: np.random.Generator) -> NDArray:
        """Return draws (m, count) of f at points x (m, d), jointly; of the first world."""
        hyper = self.hyperparameters
        k = hyper.covariance(x, self.points)
        half = k @ self.root.T
        covariance = hyper.covariance(x, x) - half @ half.T
        # Rounding leaves eigenvalues just below zero.
        values, vectors = np.linalg.eigh(0.5 * (covariance + covariance.T))
        spread = vectors * np.sqrt(np.maximum(values, 0.0))
        mean = hyper.mean + k @ self.alpha[:, :1]
        return mean + spread @ rng.standard_normal((len(x), count))

    @property
    def _floor(self) -> float:
        # Below this the difference of k(x, x) and its reduction is rounding error.
        return 1e-13 * self.hyperparameters.prior_variance


def condition(hyper: Hyperparameters, points: NDArray, targets: NDArray, noise: ArrayLike) -> Posterior:
    """Return the process of known hyperparameters that has seen `targets`.

    Parameters
    ----------
    hyper : Hyperparameters
        Its noise is not used.
    points : ndarray (n, d)
        In the unit cube.
    targets : ndarray (n, w)
        One column a world.
    noise : float or array-like (n,)
        Variance of each target's noise.
    """
    K = hyper.covariance(points, points)
    K[np.diag_indices_from(K)] += noise
    factor = _cholesky(K)
    root = np.linalg.inv(factor)
    alpha = root.T @ (root @ (targets - hyper.mean))
    return Posterior(hyper, points.copy(), alpha, root)


def _cholesky(K: NDArray) -> NDArray:
    """Lower factor of K, of which points too near to each other are told apart by as much noise as it takes."""
    scale = float(np.diag(K).mean())
    for jitter in (1e-10, 1e-8, 1e-6, 1e-4):
        try:
            return np.linalg.cholesky(K + jitter * scale * np.eye(len(K)))
        except np.linalg.LinAlgError:
            continue
    raise np.linalg.LinAlgError("a kernel matrix is not positive definite")
