"""Where experiments fail: a Gaussian process of a latent value behind success and failure, by Laplace's method."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ._evidence import KernelMatrix, descend, import_gpy, kernel_bounds
from ._posterior import Hyperparameters, Posterior
from ._prior import LIKELY_VARIANCE, lengthscale_penalty, variance_penalty


@dataclass(frozen=True, eq=False)
class _Given:
    """What GPy asks of a kernel: its matrix, which is known, and whether it has a derivative."""

    matrix: NDArray
    size: int = 1
    is_fixed: bool = False

    def K(self, points: NDArray) -> NDArray:
        return self.matrix


class _Loss:
    """Minus the log posterior density of z = log variance, log lengthscales, given which points failed.

    The latent value has a mean of the same variance, which all points share: how much of the box fails is not known.
    """

    def __init__(self, points: NDArray, failed: NDArray, kernel: str) -> None:
        gpy = import_gpy()
        self.points, self.labels = points, failed.astype(float)[:, None]
        self.matrix = KernelMatrix(kernel, points)
        self.likelihood = gpy.likelihoods.Bernoulli()
        self.inference = gpy.inference.latent_function_inference.Laplace()

    def infer(self, z: NDArray) -> tuple[object, float, dict[str, NDArray]]:
        kernel = _Given(self.matrix(z) + np.exp(z[0]))
        posterior, evidence, by = self.inference.inference(kernel, self.points, self.likelihood, self.labels)
        return posterior, float(np.squeeze(evidence)), by

    def __call__(self, z: NDArray) -> tuple[float, NDArray]:
        try:
            _, evidence, by = self.infer(z)
        except np.linalg.LinAlgError:
            return 1e10, np.zeros_like(z)
        gradient = -self.matrix.gradient(by["dL_dK"])
        gradient[0] -= np.exp(z[0]) * by["dL_dK"].sum()
        of_scales, by_scales = lengthscale_penalty(z[1:])
        of_variance, by_variance = variance_penalty(z[:1])
        return of_variance + of_scales - evidence, gradient + np.concatenate([by_variance, by_scales])


def classify(points: NDArray, failed: NDArray, kernel: str) -> Posterior:
    """Return the process g of which an experiment fails with probability Phi(g) (Rasmussen and Williams 2006, ch. 3).

    Where its mean is m and its deviation s, the probability of failure is Phi(m / sqrt(1 + s^2)), eq. 3.82. Far from
    all data it is about the share of failures among them.

    Parameters
    ----------
    points : ndarray (n, d)
        In the unit cube.
    failed : ndarray of bool (n,)
    kernel : str
    """
    loss = _Loss(points, failed, kernel)
    d = points.shape[1]
    start = np.concatenate([[np.log(LIKELY_VARIANCE)], np.full(d, 0.5 * np.log(d))])
    best = descend(loss, [start], kernel_bounds(d), iterations=40)
    posterior, _, _ = loss.infer(best)
    variance = float(np.exp(best[0]))
    hyper = Hyperparameters(kernel, 0.0, variance, 0.0, np.exp(best[1:]), common=variance)
    # The inverse is symmetric to rounding only, and its factor must exist.
    inverse = 0.5 * (posterior.woodbury_inv + posterior.woodbury_inv.T)  # pyright: ignore[reportAttributeAccessIssue]
    values, vectors = np.linalg.eigh(inverse)
    root = (vectors * np.sqrt(np.maximum(values, 0.0))).T
    alpha = np.array(posterior.woodbury_vector)[:, :1]  # pyright: ignore[reportAttributeAccessIssue]
    return Posterior(hyper, points.copy(), alpha, root)
