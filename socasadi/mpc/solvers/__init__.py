"""The QP solvers by name, the project's own among them, and the conditions that every answer has to meet."""

from ._active_set import ActiveSet, RowAnswer
from ._qp import (
    BACKENDS,
    CONIC,
    KKT_TOLERANCE,
    QuadraticProgram,
    Shape,
    below,
    check_backend,
    finite,
    kkt_residual,
    qp_solver,
    quiet,
)
from ._solve import Answer, solve

__all__ = [
    "BACKENDS",
    "CONIC",
    "KKT_TOLERANCE",
    "ActiveSet",
    "Answer",
    "QuadraticProgram",
    "RowAnswer",
    "Shape",
    "below",
    "check_backend",
    "finite",
    "kkt_residual",
    "qp_solver",
    "quiet",
    "solve",
]
