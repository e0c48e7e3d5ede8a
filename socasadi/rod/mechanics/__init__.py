"""The equations of a rod: kinematics, dynamics and statics from a rod's description, as CasADi Functions."""

from ._holding import Holding
from ._linear import Linearisation, Modes, linearise, modes
from ._model import RodModel
from ._statics import Equilibrium, EquilibriumError, Statics
from ._step import reference, substeps, w_method

__all__ = [
    "Equilibrium",
    "EquilibriumError",
    "Holding",
    "Linearisation",
    "Modes",
    "RodModel",
    "Statics",
    "linearise",
    "modes",
    "reference",
    "substeps",
    "w_method",
]
