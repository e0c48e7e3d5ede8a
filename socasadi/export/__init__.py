"""A controller written out as a folder of C with its test."""

from ._record import ControllerRecord
from ._write import ExportError, build_and_replay, export

__all__ = ["ControllerRecord", "ExportError", "build_and_replay", "export"]
