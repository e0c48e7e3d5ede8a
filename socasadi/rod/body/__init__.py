"""What a rod is made of: frozen dataclasses of numbers in SI units, and functions along the rod."""

from ._basis import Basis, BSpline, Legendre, UserBasis, piecewise_constant, piecewise_linear
from ._cable import Cable, Chamber, Converging, Helix, cables_around
from ._division import Division
from ._load import DistributedLoad, Drag, Payload, PointLoad
from ._material import Material
from ._section import Section, Taper
from ._strain import Strain

__all__ = [
    "BSpline",
    "Basis",
    "Cable",
    "Chamber",
    "Converging",
    "DistributedLoad",
    "Division",
    "Drag",
    "Helix",
    "Legendre",
    "Material",
    "Payload",
    "PointLoad",
    "Section",
    "Strain",
    "Taper",
    "UserBasis",
    "cables_around",
    "piecewise_constant",
    "piecewise_linear",
]
