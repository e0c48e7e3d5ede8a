from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from math import ceil
from typing import Any

import casadi as ca
import numpy as np

from .._checks import Number, matrix, positive_number, symmetric, whole
from .._quadrature import gauss_legendre
from ._material import Material
from ._section import Section
from ._strain import STRAINS, Strain

_FEWEST_POINTS = 6  # along a division in one piece, by default


@dataclass(frozen=True)
class Division:
    """A part of a rod with one material, one law for its section and one set of strains.

    What varies along it is a function of x = s / L, 0 at the division's base and 1 at its tip.

    Parameters
    ----------
    length
        L, m.
    section
        A :class:`Section`, or a function of the number x that returns one, such as :class:`Taper`.
    material
        Of the whole division.
    strain
        Which strains it has.
    stiffness, damping
        The section's stiffness and viscous stiffness, in place of the material's: (6, 6), or six numbers for a
        diagonal, or a function of the number x that returns one of these. In the order of the strains: N m^2 and
        N m^2 s in the first three rows, N and N s in the last. Stiffness is symmetric positive definite, damping
        symmetric positive semidefinite.
    quadrature_points
        Gauss-Legendre points in each piece of the division (it has one, unless a strain or a load has a break
        inside). None takes six points in one piece, more where the strain's degree asks for it: enough to place the
        tip of a bent rod of given strain to some 1e-5 of its length.

    Raises
    ------
    ValueError
        A value is out of range, or there are too few quadrature points for the strain, or its functions are linearly
        dependent: either would leave the mass matrix singular.

    Examples
    --------
    A tapered silicone finger, and a division of a known bending stiffness of 0.1 N m^2 with rigid shear:

    >>> silicone = Material(young=1e6, poisson=0.5, density=1000, damping=1e4)
    >>> finger = Division(0.1, Taper("circle", base=0.01, tip=0.005), silicone, Strain(bending_y=2, bending_z=2))
    >>> measured = Division(0.1, Section.circle(0.01), silicone, Strain(bending_z=1), stiffness=(1, 0.1, 0.1, 1, 1, 1))
    """

    length: float
    section: Section | Callable[[float], Section]
    material: Material
    strain: Strain
    stiffness: Any = None
    damping: Any = None
    quadrature_points: int | None = None

    def __post_init__(self) -> None:
        positive_number("Division", length=self.length)
        object.__setattr__(self, "length", float(self.length))
        for name, kind in (("material", Material), ("strain", Strain)):
            if not isinstance(value := getattr(self, name), kind):
                raise TypeError(f"Division: {name} is {value!r}, but must be a {kind.__name__}")
        if not isinstance(self.section, Section) and not callable(self.section):
            raise TypeError(
                f"Division: section is {self.section!r}, but must be a Section or a function that returns one"
            )
        for x in (0.0, 0.5, 1.0):
            if not isinstance(section := self.section_at(x), Section):
                raise TypeError(f"Division: section is {section!r} at x = {x}, but must be a Section")
            for sectional in (self.stiffness_at, self.damping_at):
                sectional(x)
        for name in ("stiffness", "damping"):
            given = getattr(self, name)
            if given is not None and not callable(given):
                object.__setattr__(self, name, matrix("Division", name, given, 6))
        if self.quadrature_points is not None:
            points = whole("Division", "quadrature_points", self.quadrature_points, 1)
            object.__setattr__(self, "quadrature_points", points)
        self._check_rank()

    @property
    def dof(self) -> int:
        """Number of strain coordinates."""
        return self.strain.dof

    def section_at(self, x: float) -> Section:
        """The section at ``x``."""
        if isinstance(self.section, Section):
            return self.section
        try:
            return self.section(x)
        except Exception as error:
            raise ValueError(f"Division: section fails at x = {x:g}: {error}") from error

    def inertia_at(self, x: float) -> list[Number]:
        """Diagonal (6,) of the section's mass matrix per metre: kg m in the first three, kg/m in the last."""
        section, rho = self.section_at(x), self.material.density
        moments = (section.Ix, section.Iy, section.Iz, section.area, section.area, section.area)
        return [rho * moment for moment in moments]

    def stiffness_at(self, x: float) -> ca.SX:
        """Stiffness (6, 6) of the section: diag(GJ, EIy, EIz, EA, GA, GA), or the given one."""
        if self.stiffness is not None:
            return self._given("stiffness", x)
        section, E, G = self.section_at(x), self.material.young, self.material.shear_modulus
        shear = section.shear_correction * G * section.area
        diagonal = [G * section.J, E * section.Iy, E * section.Iz, E * section.area, shear, shear]
        return ca.diag(ca.SX(ca.vertcat(*diagonal)))

    def damping_at(self, x: float) -> ca.SX:
        """Viscous stiffness (6, 6) of the section: eta diag(Ix, 3 Iy, 3 Iz, 3 A, A, A), or the given one."""
        if self.damping is not None:
            return self._given("damping", x)
        section, eta = self.section_at(x), self.material.damping
        moments = (section.Ix, 3 * section.Iy, 3 * section.Iz, 3 * section.area, section.area, section.area)
        return ca.diag(ca.SX(ca.vertcat(*(eta * moment for moment in moments))))

    def points_in(self, piece: float) -> int:
        """Quadrature points in a piece that is the fraction ``piece`` of the division."""
        if self.quadrature_points is not None:
            return self.quadrature_points
        # Poses converge with the fourth power of the points: what the basis resolves, they must not spoil.
        share = ceil(max(_FEWEST_POINTS, 2 * self.strain.degree + 2) * piece - 1e-9)
        return max(share, self.strain.degree + 2)

    def _given(self, name: str, x: float) -> ca.SX:
        given = getattr(self, name)
        value = given(x) if callable(given) else given
        rows = symmetric("Division", name, value, 6, definite=name == "stiffness")
        return ca.SX(ca.vertcat(*(ca.horzcat(*row) for row in rows)))

    def _check_rank(self) -> None:
        """ValueError when some coordinates move no quadrature point: the mass matrix would be singular."""
        edges = [0.0, *self.strain.breaks, 1.0]
        counts = [self.points_in(b - a) for a, b in pairwise(edges)]
        rows = np.array(self.strain.rows)
        inside = gauss_legendre(self.strain.degree + 8)[0]
        fine = np.concatenate([a + (b - a) * inside for a, b in pairwise(edges)])
        for row in dict.fromkeys(rows):
            values = self.strain.tabulate(fine)[:, rows == row]
            name = STRAINS[row]
            if not np.isfinite(values).all():
                raise ValueError(f"Division: the basis of {name} is not finite all along")
            if np.linalg.matrix_rank(values, tol=1e-9 * np.linalg.norm(values, 2)) < values.shape[1]:
                raise ValueError(
                    f"Division: the {values.shape[1]} basis functions of {name} are linearly dependent, which makes "
                    "the mass matrix singular; leave out those that others make up"
                )
            if sum(counts) < values.shape[1]:
                raise ValueError(
                    f"Division: quadrature_points is {self.quadrature_points!r}, but must be at "
                    f"least {-(-values.shape[1] // len(counts))} for the {values.shape[1]} functions of {name}: fewer "
                    "make the mass matrix singular"
                )
