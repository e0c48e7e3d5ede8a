"""What every method is given: a robot for a time, a search for its own numbers, a law that keeps the bounds."""

from ._allocation import Allocation
from ._bounded import Bounded
from ._foresight import FORESIGHT, Foresight
from ._lab import BudgetSpent, Lab, check_lent
from ._law import Forecast, Law, Program, looked_ahead
from ._method import Information, Method, Probed, offers_of
from ._models import believed, identified, static_gain
from ._settings import check_count, check_least
from ._tuned import BESIDE_MODEL, tuned

__all__ = [
    "BESIDE_MODEL",
    "FORESIGHT",
    "Allocation",
    "Bounded",
    "BudgetSpent",
    "Forecast",
    "Foresight",
    "Information",
    "Lab",
    "Law",
    "Method",
    "Probed",
    "Program",
    "believed",
    "check_count",
    "check_least",
    "check_lent",
    "identified",
    "looked_ahead",
    "offers_of",
    "static_gain",
    "tuned",
]
