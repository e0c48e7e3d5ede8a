from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from ._checks import numbers

STRAINS = ("torsion", "bending_y", "bending_z", "stretch", "shear_y", "shear_z")
"""The six strains (kx, ky, kz, sx, sy, sz), in the order in which coordinates and twists hold them."""


@dataclass(frozen=True)
class Strain:
    """Which strains a rod has, each as a sum of Legendre polynomials along the rod.

    The strain field is xi(s) = rest + Phi(s) q with the coordinates q ordered as torsion, bending_y, bending_z,
    stretch, shear_y, shear_z, and within a strain by polynomial order: P_k(2 s / L - 1), k = 0 .. order.
    (Strain parametrisation: Renda et al., IEEE RA-L 5(3), 2020, arXiv 1912.11285.)

    Parameters
    ----------
    bending_y, bending_z, torsion, stretch, shear_y, shear_z
        Polynomial order, 0 for constant; None holds that strain at its rest value. ``bending_y`` is the
        curvature about y: positive bends +x towards -z; ``bending_z`` positive bends +x towards +y.
    rest
        Strain of the unloaded rod (kx, ky, kz in 1/m, sx, sy, sz), the same all along.

    Raises
    ------
    ValueError
        An order is not a whole number at or above zero, all are None, or rest is not six finite numbers with
        a positive stretch.
    """

    bending_y: int | None = None
    bending_z: int | None = None
    torsion: int | None = None
    stretch: int | None = None
    shear_y: int | None = None
    shear_z: int | None = None
    rest: tuple[float, ...] = (0.0, 0.0, 0.0, 1.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        for name in STRAINS:
            order = getattr(self, name)
            if order is not None and (isinstance(order, bool) or not isinstance(order, int) or order < 0):
                raise ValueError(f"Strain: {name} is {order!r}, but must be None or a polynomial order 0, 1, 2, ...")
        if self.dof == 0:
            raise ValueError(f"Strain: no strain is free; give at least one of {', '.join(STRAINS)} an order")
        object.__setattr__(self, "rest", numbers("Strain", "rest", self.rest, 6))
        if self.rest[3] <= 0:
            raise ValueError(f"Strain: the rest stretch is {self.rest[3]!r}, but must be above zero")

    @property
    def orders(self) -> tuple[int, ...]:
        """Polynomial order of each of the six strains, -1 where it is held."""
        return tuple(-1 if (order := getattr(self, name)) is None else order for name in STRAINS)

    @property
    def dof(self) -> int:
        """Number of coordinates."""
        return sum(order + 1 for order in self.orders)

    @property
    def sparsity(self) -> ca.Sparsity:
        """Pattern (6, dof) of the basis matrix."""
        return ca.Sparsity.triplet(6, self.dof, self._rows, list(range(self.dof)))

    def nonzeros(self, x: Any) -> list[Any]:
        """Nonzero entries of the basis matrix at ``x`` = s / L, a number or a symbol: one per coordinate."""
        values = _legendre(max(self.orders), x)
        return [values[k] for order in self.orders for k in range(order + 1)]

    def basis(self, x: float) -> ca.DM:
        """Basis matrix Phi (6, dof) at ``x`` = s / L, with :attr:`sparsity`."""
        return ca.DM(self.sparsity, self.nonzeros(x))

    def gram(self, diagonal: np.ndarray) -> np.ndarray:
        """Integral over x from 0 to 1 of Phi' diag(``diagonal``) Phi, (dof, dof), exact."""
        nodes, weights = gauss_legendre(max(self.orders) + 1)
        total = np.zeros((self.dof, self.dof))
        for x, weight in zip(nodes, weights, strict=True):
            basis = self.basis(x).full()
            total += weight * basis.T @ (diagonal[:, None] * basis)
        return total

    @property
    def _rows(self) -> list[int]:
        return [row for row, order in enumerate(self.orders) for _ in range(order + 1)]


def gauss_legendre(points: int) -> tuple[np.ndarray, np.ndarray]:
    """Nodes and weights (points,) of Gauss-Legendre quadrature on [0, 1]."""
    nodes, weights = np.polynomial.legendre.leggauss(points)
    return (nodes + 1) / 2, weights / 2


def _legendre(order: int, x: Any) -> list[Any]:
    t = 2 * x - 1
    values = [1.0, t]
    for k in range(1, order):
        values.append(((2 * k + 1) * t * values[k] - k * values[k - 1]) / (k + 1))
    return values[: order + 1]
