"""Robots as a closed-loop experiment sees them: reset, step, measure."""

from ._external import ExternalPlant, ExternalPlantError
from ._output import Camera, LaserSpot, Output, TipDisplacement
from ._protocol import Plant, PlantFailure
from ._simulated import SimulatedPlant

__all__ = [
    "Camera",
    "ExternalPlant",
    "ExternalPlantError",
    "LaserSpot",
    "Output",
    "Plant",
    "PlantFailure",
    "SimulatedPlant",
    "TipDisplacement",
]
