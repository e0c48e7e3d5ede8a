"""A geometrically exact Cosserat rod, strain-parametrised, as CasADi Functions: kinematics, statics, dynamics.

``body`` holds what a rod is made of, ``mechanics`` the equations that follow, and :class:`Rod` puts them together.
"""

from ._pointing import pointing
from ._rod import Rod
from .body import (
    Basis,
    BSpline,
    Cable,
    Chamber,
    Converging,
    DistributedLoad,
    Division,
    Drag,
    Helix,
    Legendre,
    Material,
    Payload,
    PointLoad,
    Section,
    Strain,
    Taper,
    UserBasis,
    cables_around,
    piecewise_constant,
    piecewise_linear,
)
from .mechanics import Equilibrium, EquilibriumError, Linearisation, Modes, RodModel

__all__ = [
    "BSpline",
    "Basis",
    "Cable",
    "Chamber",
    "Converging",
    "DistributedLoad",
    "Division",
    "Drag",
    "Equilibrium",
    "EquilibriumError",
    "Helix",
    "Legendre",
    "Linearisation",
    "Material",
    "Modes",
    "Payload",
    "PointLoad",
    "Rod",
    "RodModel",
    "Section",
    "Strain",
    "Taper",
    "UserBasis",
    "cables_around",
    "piecewise_constant",
    "piecewise_linear",
    "pointing",
]
