"""Robots as a closed-loop experiment sees them: reset, step, measure."""

from ._output import Camera, LaserSpot, Output, TipDisplacement
from ._protocol import Plant, PlantFailure
from ._simulated import SimulatedPlant

__all__ = ["Camera", "LaserSpot", "Output", "Plant", "PlantFailure", "SimulatedPlant", "TipDisplacement"]
