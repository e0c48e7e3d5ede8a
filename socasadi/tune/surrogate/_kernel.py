"""Kernels: of all coordinates at once, and beside it a sum of those of each coordinate.

    k(x, z) = v s(r^2) + w/d sum_i s(d r_i^2),    r_i = (x_i - z_i) / l_i,    r^2 = sum_i r_i^2

The sum (Duvenaud, Nickisch and Rasmussen 2011, "Additive Gaussian processes") lets what was seen of a coordinate hold
wherever the others are, which a process of ten and more coordinates otherwise takes hundreds of data to see. The factor
d keeps both parts' lengthscales alike: points drawn at random are d times as far apart as their coordinates.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.distance import cdist

from .._named import choose

Shape = Callable[[NDArray], tuple[NDArray, NDArray]]
"""A stationary kernel of unit variance: of r^2 the value s and -(ds/dr) / r, finite at r = 0."""


def rbf(squared: NDArray) -> tuple[NDArray, NDArray]:
    """Gaussian kernel exp(-r^2/2)."""
    k = np.exp(-0.5 * squared)
    return k, k


def matern52(squared: NDArray) -> tuple[NDArray, NDArray]:
    """Matern-5/2 kernel (1 + s + s^2/3) exp(-s), s = sqrt(5) r (Rasmussen and Williams 2006, eq. 4.17)."""
    s = np.sqrt(5.0 * squared)
    decay = np.exp(-s)
    return (1.0 + s + s * s / 3.0) * decay, 5.0 / 3.0 * (1.0 + s) * decay


KERNELS: dict[str, Shape] = {"matern52": matern52, "rbf": rbf}


def kernel_named(name: str) -> Shape:
    """Return the shape of that name; ValueError lists the known ones."""
    return choose("kernel", KERNELS, name)


def kernel_parts(shape: Shape, apart: NDArray, variance: float, additive: float) -> tuple[NDArray, NDArray, NDArray]:
    """The two parts of the kernel (...,) at scaled differences r (..., d), and its slopes -(dk/dr_i) / r_i (..., d).

    `variance` is v, `additive` is w, which may be 0.
    """
    squared = np.square(apart)
    joint, slope = shape(squared.sum(axis=-1))
    slopes = np.broadcast_to(variance * slope[..., None], apart.shape)
    if additive == 0.0:
        return variance * joint, np.zeros_like(joint), slopes
    each, slope_of_each = shape(apart.shape[-1] * squared)
    return variance * joint, additive * each.mean(axis=-1), slopes + additive * slope_of_each


def kernel_matrix(shape: Shape, x: NDArray, z: NDArray, variance: float, additive: float) -> NDArray:
    """The kernel (m, k) between scaled points x (m, d) and z (k, d)."""
    k = variance * shape(cdist(x, z, "sqeuclidean"))[0]
    if additive != 0.0:
        d = x.shape[1]
        for a, b in zip(x.T, z.T, strict=True):
            k += additive / d * shape(d * np.square(a[:, None] - b))[0]
    return k
