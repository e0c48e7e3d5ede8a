"""Ways to get a controller, one a file."""

from ._deepc import DeePC
from ._fixed import Identified, Linearised, Subspace
from ._h_infinity import HInfinity
from ._koopman import Koopman
from ._learning import IterativeLearning
from ._nonlinear import NonlinearMPC
from ._pid import PID
from ._search import ModelSearch
from ._weights import WeightSearch

__all__ = [
    "PID",
    "DeePC",
    "HInfinity",
    "Identified",
    "IterativeLearning",
    "Koopman",
    "Linearised",
    "ModelSearch",
    "NonlinearMPC",
    "Subspace",
    "WeightSearch",
]
