from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from numbers import Integral
from typing import Any

import casadi as ca
import numpy as np

from .._checks import numbers, symbolic
from ._basis import Basis, Legendre

STRAINS = ("torsion", "bending_y", "bending_z", "stretch", "shear_y", "shear_z")
"""The six strains (kx, ky, kz, sx, sy, sz), in the order in which coordinates and twists hold them."""

_PARTS = ("size", "degree", "breaks", "values")  # of a basis


@dataclass(frozen=True)
class Strain:
    """Which strains a division of a rod has, each as a sum of functions along it.

    The strain field is xi(x) = rest(x) + Phi(x) q, x = s / L from 0 to 1, with the coordinates q ordered as torsion,
    bending_y, bending_z, stretch, shear_y, shear_z, and within a strain as its basis has them.
    (Strain parametrisation: Renda et al., IEEE RA-L 5(3), 2020, arXiv 1912.11285.)

    Parameters
    ----------
    bending_y, bending_z, torsion, stretch, shear_y, shear_z
        A basis (:class:`Legendre`, :class:`BSpline`, :class:`UserBasis`); a whole number is the order of Legendre
        polynomials, 0 for constant; None holds that strain at its rest value. ``bending_y`` is the curvature about
        y: positive bends +x towards -z; ``bending_z`` positive bends +x towards +y.
    rest
        Strain of the unloaded rod (kx, ky, kz in 1/m, sx, sy, sz): six numbers for a rod pre-curved and pre-twisted
        alike all along, or a function of x, a CasADi symbol, that returns six.

    Raises
    ------
    ValueError
        An order is not a whole number at or above zero, all are None, or rest is not six finite numbers with
        a positive stretch.

    Examples
    --------
    >>> Strain(bending_y=2, bending_z=piecewise_linear(3), stretch=0).dof
    8
    >>> quarter_circle = Strain(bending_z=1, rest=(0, 0, 1.57, 1, 0, 0))
    >>> spiral = Strain(bending_z=1, rest=lambda x: (0, 0, 2 * x, 1, 0, 0))
    """

    bending_y: int | Basis | None = None
    bending_z: int | Basis | None = None
    torsion: int | Basis | None = None
    stretch: int | Basis | None = None
    shear_y: int | Basis | None = None
    shear_z: int | Basis | None = None
    rest: tuple[Any, ...] | Callable[[ca.SX], Any] = (0.0, 0.0, 0.0, 1.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        for name in STRAINS:
            basis = getattr(self, name)
            if isinstance(basis, Legendre):  # one way to say it, so that equal strains compare equal
                object.__setattr__(self, name, basis.order)
            elif isinstance(basis, Integral) and not isinstance(basis, bool) and int(basis) >= 0:
                object.__setattr__(self, name, int(basis))
            elif basis is not None and (isinstance(basis, type) or not all(hasattr(basis, part) for part in _PARTS)):
                raise ValueError(
                    f"Strain: {name} is {basis!r}, but must be None, a polynomial order 0, 1, 2, ... or a basis"
                )
        if self.dof == 0:
            raise ValueError(f"Strain: no strain is free; give at least one of {', '.join(STRAINS)} an order")
        if callable(self.rest):
            values = [self.rest_at(ca.SX(x)) for x in np.linspace(0, 1, 5)]
        else:
            object.__setattr__(self, "rest", numbers("Strain", "rest", self.rest, 6))
            values = [ca.SX(ca.vertcat(*self.rest))]
        for rest in values:
            if not symbolic(rest[3]) and float(rest[3]) <= 0:
                raise ValueError(f"Strain: the rest stretch is {float(rest[3])!r}, but must be above zero")

    @cached_property
    def bases(self) -> tuple[tuple[int, Basis], ...]:
        """Row among the six strains, and basis, of each free one."""
        given = ((row, getattr(self, name)) for row, name in enumerate(STRAINS))
        return tuple(
            (row, Legendre(basis) if isinstance(basis, int) else basis) for row, basis in given if basis is not None
        )

    @property
    def dof(self) -> int:
        """Number of coordinates."""
        return sum(basis.size for _, basis in self.bases)

    @property
    def degree(self) -> int:
        """Highest degree of the polynomials between the breaks."""
        return max(basis.degree for _, basis in self.bases)

    @property
    def breaks(self) -> tuple[float, ...]:
        """Where in (0, 1) a function jumps or has a kink."""
        return tuple(sorted({x for _, basis in self.bases for x in basis.breaks}))

    @property
    def rows(self) -> list[int]:
        """Row among the six strains of each coordinate."""
        return [row for row, basis in self.bases for _ in range(basis.size)]

    @property
    def sparsity(self) -> ca.Sparsity:
        """Pattern (6, dof) of the basis matrix: one entry a column."""
        return ca.Sparsity.triplet(6, self.dof, self.rows, list(range(self.dof)))

    def values(self, x: ca.SX) -> ca.SX:
        """The basis functions (dof,) at ``x`` = s / L: the nonzeros of Phi."""
        return ca.vertcat(*(value for _, basis in self.bases for value in basis.values(x)))

    def rest_at(self, x: ca.SX) -> ca.SX:
        """Strain (6,) of the unloaded rod at ``x``."""
        if not callable(self.rest):
            return ca.SX(ca.vertcat(*self.rest))
        try:
            return ca.SX(ca.vertcat(*numbers("Strain", "rest(x)", self.rest(x), 6)))
        except Exception as error:
            raise ValueError(f"Strain: rest does not give six expressions for a CasADi symbol: {error}") from error

    @property
    def constant_rest(self) -> tuple[float, ...] | None:
        """The strain of the unloaded rod where it is the same six numbers all along, else None."""
        return None if callable(self.rest) or symbolic(self.rest) else self.rest

    def tabulate(self, x: np.ndarray) -> np.ndarray:
        """The basis functions (len(x), dof) at the numbers ``x``."""
        return self._tabulated.map(len(x))(ca.DM(x).T).full().T if len(x) else np.zeros((0, self.dof))

    @cached_property
    def _tabulated(self) -> ca.Function:
        x = ca.SX.sym("x")
        return ca.Function("basis", [x], [ca.densify(self.values(x))])
