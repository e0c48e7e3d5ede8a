"""A controller written out as a folder of C with its test."""

from ._accept import FLOAT_SHARE, check_single_precision
from ._build import build_and_replay
from ._errors import ExportError, NotBuiltError
from ._figures import RANDOM_SAMPLES, core_for
from ._kind import SOLVERS
from ._record import ControllerRecord
from ._sources import data_header, export_sources
from ._write import export
from .microcontroller import Core, Emulated, EmulatorError, Firmware, Footprint, build, toolchain

__all__ = [
    "FLOAT_SHARE",
    "RANDOM_SAMPLES",
    "SOLVERS",
    "ControllerRecord",
    "Core",
    "Emulated",
    "EmulatorError",
    "ExportError",
    "Firmware",
    "Footprint",
    "NotBuiltError",
    "build",
    "build_and_replay",
    "check_single_precision",
    "core_for",
    "data_header",
    "export",
    "export_sources",
    "toolchain",
]
