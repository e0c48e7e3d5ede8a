"""Linear MPC whose only open part is its prediction model: specification, design, QP solvers, controller."""

from ._compiled import CompiledController
from ._controller import Controller, ControllerInfo
from ._interpreted import InterpretedController
from ._law import control_law, rest_state
from ._library import controller_sources
from ._spec import LinearMPC
from ._tables import Real, Tables, check_real, tables
from .analysis import Analysis
from .formulation import Design, DesignError, DualProgram, InputTerm, Weight, check_input_term, weight_matrix
from .solvers import BACKENDS, KKT_TOLERANCE, ActiveSet, Answer, QuadraticProgram, RowAnswer, solve

__all__ = [
    "BACKENDS",
    "KKT_TOLERANCE",
    "ActiveSet",
    "Analysis",
    "Answer",
    "CompiledController",
    "Controller",
    "ControllerInfo",
    "Design",
    "DesignError",
    "DualProgram",
    "InputTerm",
    "InterpretedController",
    "LinearMPC",
    "QuadraticProgram",
    "Real",
    "RowAnswer",
    "Tables",
    "Weight",
    "check_input_term",
    "check_real",
    "control_law",
    "controller_sources",
    "rest_state",
    "solve",
    "tables",
    "weight_matrix",
]
