from dataclasses import dataclass

from .._checks import Number, finite, not_negative, positive, symbolic


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

    young: Number
    poisson: Number
    density: Number
    damping: Number = 0.0

    def __post_init__(self) -> None:
        positive("Material", young=self.young, density=self.density)
        not_negative("Material", damping=self.damping)
        finite("Material", poisson=self.poisson)
        if not symbolic(self.poisson) and not -1 < self.poisson <= 0.5:
            raise ValueError(f"Material: poisson is {self.poisson!r}, but must be above -1 and at most 0.5")

    @property
    def shear_modulus(self) -> Number:
        """G = E / (2 (1 + nu)), Pa."""
        return self.young / (2 * (1 + self.poisson))
