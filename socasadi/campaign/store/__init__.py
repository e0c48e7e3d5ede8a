"""What a run folder keeps: every trial in an SQLite journal, and every setting as plain data."""

from ._folder import (
    RunError,
    begun,
    compare_settings,
    journal_path,
    read_settings,
    settings_path,
    write_settings,
)
from ._journal import Journal, JournalError
from ._pack import pack, unpack
from ._settings import ForeignTypeError, describe, differences, parts, rebuild
from ._trial import Asked, Flight, Outcome, Trial

__all__ = [
    "Asked",
    "Flight",
    "ForeignTypeError",
    "Journal",
    "JournalError",
    "Outcome",
    "RunError",
    "Trial",
    "begun",
    "compare_settings",
    "describe",
    "differences",
    "journal_path",
    "pack",
    "parts",
    "read_settings",
    "rebuild",
    "settings_path",
    "unpack",
    "write_settings",
]
