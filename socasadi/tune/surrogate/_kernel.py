"""Stationary kernels with one lengthscale a dimension: values, gradients, and GPy's class of each."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from .._named import choose


class Shape(Protocol):
    """The kernel of unit variance as a function of the squared scaled distance r^2."""

    def __call__(self, squared: NDArray) -> tuple[NDArray, NDArray]:
        """Return k(r) and its slope -(dk/dr) / r, finite at r = 0; both of the shape of `squared`."""
        ...


def rbf(squared: NDArray) -> tuple[NDArray, NDArray]:
    """Gaussian kernel exp(-r^2/2)."""
    k = np.exp(-0.5 * squared)
    return k, k


def matern52(squared: NDArray) -> tuple[NDArray, NDArray]:
    """Matern-5/2 kernel (1 + s + s^2/3) exp(-s), s = sqrt(5) r (Rasmussen and Williams 2006, eq. 4.17)."""
    s = np.sqrt(5.0 * squared)
    decay = np.exp(-s)
    return (1.0 + s + s * s / 3.0) * decay, 5.0 / 3.0 * (1.0 + s) * decay


@dataclass(frozen=True)
class Kernel:
    """A kernel: its shape here, and the name of its class in GPy.kern.

    A further one is a `Kernel` added to `KERNELS`: any stationary class of GPy with `variance` and `lengthscale`.
    """

    shape: Shape
    gpy: str


KERNELS: dict[str, Kernel] = {"matern52": Kernel(matern52, "Matern52"), "rbf": Kernel(rbf, "RBF")}


def kernel_named(name: str) -> Kernel:
    """Return the kernel of that name; ValueError lists the known ones."""
    return choose("kernel", KERNELS, name)


def lengthscale_prior(dimension: int) -> tuple[float, float]:
    """Mean and deviation of log lengthscale in the unit cube, scaled with sqrt(d).

    LogNormal(sqrt(2) + log(d)/2, sqrt(3)): Hvarfner, Hellsten and Nardi 2024, "Vanilla Bayesian optimization
    performs great in high dimensions", arXiv 2402.02229.
    """
    return math.sqrt(2.0) + 0.5 * math.log(dimension), math.sqrt(3.0)
