from dataclasses import dataclass
from math import pi

from ._checks import finite, not_negative, positive


@dataclass(frozen=True)
class Material:
    """Isotropic linear elastic material with Kelvin-Voigt damping.

    Parameters
    ----------
    young
        Young's modulus E, Pa.
    poisson
        Poisson ratio nu, above -1 and up to 0.5 (rubber); the shear modulus is E / (2 (1 + nu)).
    density
        Mass density, kg/m^3.
    damping
        Kelvin-Voigt modulus eta, Pa s: the section's viscous stiffness is
        eta diag(Ix, 3 Iy, 3 Iz, 3 A, A, A), as in SoRoSim (Mathew et al. 2022, arXiv 2107.05494).

    Raises
    ------
    ValueError
        A value is out of its range.
    """

    young: float
    poisson: float
    density: float
    damping: float = 0.0

    def __post_init__(self) -> None:
        positive("Material", young=self.young, density=self.density)
        not_negative("Material", damping=self.damping)
        finite("Material", poisson=self.poisson)
        if not -1 < self.poisson <= 0.5:
            raise ValueError(f"Material: poisson is {self.poisson!r}, but must be above -1 and at most 0.5")

    @property
    def shear_modulus(self) -> float:
        """G = E / (2 (1 + nu)), Pa."""
        return self.young / (2 * (1 + self.poisson))


@dataclass(frozen=True)
class Section:
    """A cross-section by its constants, in principal axes y and z through the centroid; see :meth:`circle`.

    Parameters
    ----------
    area
        A, m^2.
    Iy, Iz
        Second moments of area about y and z, m^4.
    torsion_constant
        J, m^4, so that the torsional stiffness is G J: the polar moment for a circle, Saint-Venant's constant
        for other shapes. None takes the polar moment.
    half_widths
        Half the section's size along y and along z, m: where cables may be, and what is drawn.

    Raises
    ------
    ValueError
        A value is not above zero.
    """

    area: float
    Iy: float
    Iz: float
    torsion_constant: float | None = None
    half_widths: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        if self.torsion_constant is None:
            object.__setattr__(self, "torsion_constant", self.Iy + self.Iz)
        positive("Section", area=self.area, Iy=self.Iy, Iz=self.Iz, torsion_constant=self.torsion_constant or 0.0)
        if self.half_widths is not None:
            y, z = self.half_widths
            positive("Section", half_width_y=y, half_width_z=z)
            object.__setattr__(self, "half_widths", (float(y), float(z)))

    @property
    def Ix(self) -> float:
        """Polar second moment of area Iy + Iz, m^4."""
        return self.Iy + self.Iz

    @classmethod
    def circle(cls, radius: float, torsion_constant: float | None = None) -> "Section":
        """Full circle of ``radius``, m; its torsion constant is the polar moment unless given."""
        positive("Section.circle", radius=radius)
        moment = pi * radius**4 / 4
        return cls(pi * radius**2, moment, moment, torsion_constant, (radius, radius))
