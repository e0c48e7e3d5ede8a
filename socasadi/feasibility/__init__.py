"""Can this work at all? Asked before any experiment: reach, effort, speed, timing, noise, weight, model, arithmetic."""

from ._check import check, check_record
from ._finding import VERDICTS, Check, Finding, Picture, Verdict
from ._spec_sheet import SpecSheetError, read_spec_sheet

__all__ = [
    "VERDICTS",
    "Check",
    "Finding",
    "Picture",
    "SpecSheetError",
    "Verdict",
    "check",
    "check_record",
    "read_spec_sheet",
]
