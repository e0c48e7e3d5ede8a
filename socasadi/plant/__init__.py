"""Robots as a closed-loop experiment sees them: reset, step, measure."""

from ._output import LaserSpot, Output, TipDisplacement
from ._protocol import Plant, PlantFailure
from ._simulated import SimulatedPlant

__all__ = ["LaserSpot", "Output", "Plant", "PlantFailure", "SimulatedPlant", "TipDisplacement"]
