"""What is believed of the cost between the experiments: transforms, Gaussian processes, where experiments fail."""

from ._data import Data, cost_data, plain_data, surrogate
from ._evidence import import_gpy
from ._feasibility import classify
from ._fit import FitSettings, draw, evidence, fit
from ._posterior import Hyperparameters, Posterior, condition
from ._transform import Scale, Transform, transform_named

__all__ = [
    "Data",
    "FitSettings",
    "Hyperparameters",
    "Posterior",
    "Scale",
    "Transform",
    "classify",
    "condition",
    "cost_data",
    "draw",
    "evidence",
    "fit",
    "import_gpy",
    "plain_data",
    "surrogate",
    "transform_named",
]
