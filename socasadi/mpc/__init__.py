"""Linear MPC whose only open part is its prediction model: specification, design, QP solvers, controller."""

from ._controller import Controller, ControllerInfo
from ._design import Design, DesignError
from ._law import control_law, rest_state
from ._qp import BACKENDS, KKT_TOLERANCE
from ._spec import LinearMPC
from ._weights import InputTerm, Weight, check_input_term, weight_matrix

__all__ = [
    "BACKENDS",
    "KKT_TOLERANCE",
    "Controller",
    "ControllerInfo",
    "Design",
    "DesignError",
    "InputTerm",
    "LinearMPC",
    "Weight",
    "check_input_term",
    "control_law",
    "rest_state",
    "weight_matrix",
]
