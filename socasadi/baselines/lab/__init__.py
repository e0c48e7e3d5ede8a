"""What every method is given: a robot for a time, a search for its own numbers, a law that keeps the bounds."""

from ._allocation import Allocation
from ._lab import BudgetSpent, Lab
from ._law import Forecast, Law, Program, looked_ahead
from ._method import Information, Method
from ._models import believed, identified, static_gain
from ._tuned import BESIDE_MODEL, tuned

__all__ = [
    "BESIDE_MODEL",
    "Allocation",
    "BudgetSpent",
    "Forecast",
    "Information",
    "Lab",
    "Law",
    "Method",
    "Program",
    "believed",
    "identified",
    "looked_ahead",
    "static_gain",
    "tuned",
]
