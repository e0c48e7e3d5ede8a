"""From a prediction model to the numbers of its controller, symbolic in the model: observer, condensed QP, its dual."""

from ._design import SINGULAR, Design, DesignError
from ._dual import DualProgram, dual_program
from ._formulation import NUMBERS, design_function
from ._moves import block_lengths
from ._observer import Noise
from ._weights import (
    InputTerm,
    Weight,
    bound_pair,
    check_input_term,
    covariance,
    hashable,
    positive_numbers,
    weight_matrix,
)

__all__ = [
    "NUMBERS",
    "SINGULAR",
    "Design",
    "DesignError",
    "DualProgram",
    "InputTerm",
    "Noise",
    "Weight",
    "block_lengths",
    "bound_pair",
    "check_input_term",
    "covariance",
    "design_function",
    "dual_program",
    "hashable",
    "positive_numbers",
    "weight_matrix",
]
