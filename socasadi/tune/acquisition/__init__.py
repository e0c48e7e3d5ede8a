"""Where to ask next: merits of a point under the surrogate, and their maximisation."""

from ._improvement import (
    Acquisition,
    acquisition_named,
    confidence_bound,
    expected_improvement,
    log_expected_improvement,
)
from ._maximise import SAME_POINT, Admissible, maximise
from ._merit import Constraint, Merit

__all__ = [
    "SAME_POINT",
    "Acquisition",
    "Admissible",
    "Constraint",
    "Merit",
    "acquisition_named",
    "confidence_bound",
    "expected_improvement",
    "log_expected_improvement",
    "maximise",
]
