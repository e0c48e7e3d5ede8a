"""A controller written out as a folder of C with its test."""

from ._record import ControllerRecord
from ._write import ExportError, NotBuiltError, build_and_replay, export

__all__ = ["ControllerRecord", "ExportError", "NotBuiltError", "build_and_replay", "export"]
