"""Other ways to get a controller, each lent the same robot for the same time, and the comparison of them all.

A method is a :class:`Method`: it spends the time of a :class:`Lab` and offers controllers. What it may know and what an
experiment costs is the same for all: see there.
"""

from ._compare import Comparison, Size, fly_cell, load_comparison, run_comparison, stored_cells
from ._deepc import DeePC
from ._fixed import Identified, Linearised, Subspace
from ._judge import Elsewhere, Worth, worth, worth_elsewhere
from ._koopman import Koopman
from ._lab import BudgetSpent, Lab
from ._law import Forecast, Law, Program, looked_ahead
from ._learning import IterativeLearning
from ._method import Information, Method, identified, static_gain, tuned
from ._nonlinear import NonlinearMPC
from ._others import DeadCable, Delayed, Loaded, Misrouted, Noisier, Rubbing, Softer
from ._pid import PID
from ._robust import HInfinity
from ._search import ModelSearch
from ._summary import Summary
from ._summary import table as summary_table
from ._weights import WeightSearch

__all__ = [
    "PID",
    "BudgetSpent",
    "Comparison",
    "DeadCable",
    "DeePC",
    "Delayed",
    "Elsewhere",
    "Forecast",
    "HInfinity",
    "Identified",
    "Information",
    "IterativeLearning",
    "Koopman",
    "Lab",
    "Law",
    "Linearised",
    "Loaded",
    "Method",
    "Misrouted",
    "ModelSearch",
    "Noisier",
    "NonlinearMPC",
    "Program",
    "Rubbing",
    "Size",
    "Softer",
    "Subspace",
    "Summary",
    "WeightSearch",
    "Worth",
    "fly_cell",
    "identified",
    "load_comparison",
    "looked_ahead",
    "run_comparison",
    "static_gain",
    "stored_cells",
    "summary_table",
    "tuned",
    "worth",
    "worth_elsewhere",
]
