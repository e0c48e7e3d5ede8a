"""Warping of the inputs: each coordinate of the unit cube through a Kumaraswamy distribution function."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

# Of log a and log b, about the identity: Snoek, Swersky, Zemel and Adams 2014, "Input warping for Bayesian
# optimization of non-stationary functions", ICML.
PRIOR_DEVIATION = 0.75
BOUNDS = (-1.5, 1.5)

# The slope may be infinite at the faces.
_EDGE = 1e-9


@dataclass(frozen=True, eq=False)
class Warp:
    """w(x) = 1 - (1 - x^a)^b, coordinate by coordinate.

    Parameters
    ----------
    a, b : ndarray (d,)
        Positive; ones leave the cube as it is.
    """

    a: NDArray
    b: NDArray

    def __call__(self, x: NDArray) -> NDArray:
        """Return the warped points, of the shape of `x` (..., d)."""
        return 1.0 - (1.0 - _inside(x) ** self.a) ** self.b

    def slope(self, x: NDArray) -> NDArray:
        """Return dw/dx, of the shape of `x`."""
        x = _inside(x)
        return self.a * self.b * x ** (self.a - 1.0) * (1.0 - x**self.a) ** (self.b - 1.0)

    def by_logs(self, x: NDArray) -> tuple[NDArray, NDArray]:
        """Return dw/dlog a and dw/dlog b, of the shape of `x`."""
        x = _inside(x)
        power = x**self.a
        rest = 1.0 - power
        by_a = self.b * rest ** (self.b - 1.0) * power * np.log(x) * self.a
        by_b = -(rest**self.b) * np.log(rest) * self.b
        return by_a, by_b


def _inside(x: NDArray) -> NDArray:
    return np.clip(x, _EDGE, 1.0 - _EDGE)
