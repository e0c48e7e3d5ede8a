from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class DualProgram:
    r"""A quadratic program as its rows see it, what a dual active-set method starts from.

    With :math:`z_0 = -H^{-1} F p` the unconstrained optimum, multipliers :math:`\lambda` of the rows move it to
    :math:`z = z_0 - H^{-1} A' \lambda`, so that the rows' values are

    .. math:: A z + E p = \underbrace{(E - A H^{-1} F)}_{map}\, p - \underbrace{A H^{-1} A'}_{gram} \lambda .

    This is the program in minimum-distance form (Arnström, Bemporad, Axehill, IEEE Trans. Automatic Control 67, 2022:
    with :math:`H = R'R` and :math:`M = A R^{-1}`), of which the dual needs :math:`M M'` only. It is formed here once
    and for all, so that nothing online grows with the number of moves. Rows are scaled such that the diagonal of
    gram, softness included, is 1.

    Attributes
    ----------
    map
        (rows, parameters).
    gram
        (rows, rows).
    lower, upper
        (rows,).
    softness
        (rows,) inverse of the quadratic weight, 0 of a hard row.
    price
        (rows,) linear weight.
    unit
        (rows,) what 1 in a scaled row is in the row's own unit.
    """

    map: np.ndarray
    gram: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    softness: np.ndarray
    price: np.ndarray
    unit: np.ndarray


def dual_program(
    hessian: np.ndarray,
    gradient: np.ndarray,
    rows: np.ndarray,
    row_free: np.ndarray,
    row_lower: np.ndarray,
    row_upper: np.ndarray,
    quadratic: np.ndarray,
    price: np.ndarray,
) -> DualProgram:
    """The dual of the quadratic program of a :class:`Design`, whose fields these are."""
    # (NumPy's inverse of so small a triangle, for the triangular solvers wake threads that take longer than it.)
    root = np.linalg.inv(np.linalg.cholesky(hessian))
    distance, soft = rows @ root.T, 1 / quadratic
    gram = distance @ distance.T
    # A row that no move reaches has no length of its own: if it is soft, its softness gives it one.
    unit = np.sqrt(np.diag(gram) + soft)
    unit[unit == 0] = 1.0
    return DualProgram(
        map=(row_free - distance @ (root @ gradient)) / unit[:, None],
        gram=gram / np.outer(unit, unit),
        lower=row_lower / unit,
        upper=row_upper / unit,
        softness=soft / unit**2,
        price=price * unit,
        unit=unit,
    )
