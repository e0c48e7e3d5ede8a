"""A geometrically exact Cosserat rod, strain-parametrised, as CasADi Functions: kinematics, statics, dynamics."""

from ._cable import Cable, cables_around
from ._linear import Linearisation, Modes
from ._material import Material, Section
from ._model import RodModel
from ._rod import Rod
from ._statics import Equilibrium, EquilibriumError
from ._strain import Strain

__all__ = [
    "Cable",
    "Equilibrium",
    "EquilibriumError",
    "Linearisation",
    "Material",
    "Modes",
    "Rod",
    "RodModel",
    "Section",
    "Strain",
    "cables_around",
]
