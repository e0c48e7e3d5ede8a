"""An emulated microcontroller with an exported controller on it: what it costs there, and a processor in the loop."""

from ._emulated import Emulated, Footprint, Sample
from ._firmware import CORTEX_M4, CORTEX_M7, LONGEST_CALL, Core, EmulatorError, Firmware, build, toolchain

__all__ = [
    "CORTEX_M4",
    "CORTEX_M7",
    "LONGEST_CALL",
    "Core",
    "Emulated",
    "EmulatorError",
    "Firmware",
    "Footprint",
    "Sample",
    "build",
    "toolchain",
]
