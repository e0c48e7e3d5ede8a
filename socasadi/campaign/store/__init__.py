"""What a run folder keeps: every trial in an SQLite journal, and every setting as plain data."""

from ._journal import Flight, Journal, JournalError, Trial
from ._settings import ForeignTypeError, describe, differences, rebuild

__all__ = [
    "Flight",
    "ForeignTypeError",
    "Journal",
    "JournalError",
    "Trial",
    "describe",
    "differences",
    "rebuild",
]
