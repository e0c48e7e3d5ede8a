from collections.abc import Sequence
from typing import Literal, get_args

import numpy as np

InputTerm = Literal["rate", "normalised", "literal"]
"""What a weight R on the input weighs: the change of u/u_max from one sample to the next, u/u_max, or u in newtons."""

Weight = float | Sequence[float] | Sequence[Sequence[float]]


def weight_matrix(weight: Weight, size: int, name: str) -> np.ndarray:
    """The positive semidefinite (size, size) matrix that a number, a diagonal or a whole matrix stands for."""
    try:
        values = np.asarray(weight)
    except ValueError:
        values = np.asarray(None)
    if values.dtype.kind not in "fiu":
        raise ValueError(f"{name} is a number, {size} numbers or a ({size}, {size}) matrix, not {weight!r}")
    values = values.astype(float)
    if values.ndim == 0:
        matrix = values * np.eye(size)
    elif values.shape == (size,):
        matrix = np.diag(values)
    elif values.shape == (size, size):
        matrix = values
    else:
        raise ValueError(
            f"{name} is a number, {size} numbers or a ({size}, {size}) matrix, not of shape {values.shape}"
        )
    if not np.isfinite(matrix).all() or np.abs(matrix - matrix.T).max() > 1e-12 * np.abs(matrix).max():
        raise ValueError(f"{name} must be finite and symmetric, not {weight}")
    if np.linalg.eigvalsh(matrix)[0] < -1e-12 * np.abs(matrix).max():
        raise ValueError(f"{name} must be positive semidefinite, not {weight}")
    return matrix


def hashable(value):
    """``value`` with its lists and arrays as nested tuples."""
    if isinstance(value, np.ndarray):
        value = value.tolist()
    return tuple(hashable(item) for item in value) if isinstance(value, list | tuple) else value


def check_input_term(term: str) -> None:
    """ValueError when no input term goes by that name."""
    if term not in get_args(InputTerm):
        raise ValueError(f"unknown input_term {term!r}; there are {', '.join(get_args(InputTerm))}")


def positive_numbers(values, size: int, name: str, *, zero: bool = False) -> np.ndarray:
    """(size,) from a number or ``size`` numbers, each positive, or not negative where ``zero`` is allowed."""
    try:
        array = np.asarray(values)
    except ValueError:
        array = np.asarray(None)
    if array.dtype.kind not in "fiu" or array.shape not in ((), (size,)):
        raise ValueError(f"{name} is a number or {size} numbers, not {values!r}")
    array = array.astype(float)
    if not np.isfinite(array).all() or (array < 0).any() or (not zero and (array == 0).any()):
        raise ValueError(f"{name} must be {'zero or ' if zero else ''}positive, not {values!r}")
    return np.broadcast_to(array, (size,)).copy()


def covariance(noise, size: int, name: str, *, definite: bool = False) -> np.ndarray:
    """(size, size) from standard deviations, one or ``size`` of them, or from a covariance matrix."""
    if np.ndim(noise) < 2 or not isinstance(noise, tuple | list | np.ndarray):
        try:
            return np.diag(positive_numbers(noise, size, name) ** 2)
        except ValueError as error:
            if "must be positive" in str(error):
                raise
            raise ValueError(
                f"{name} is a standard deviation, {size} of them or a ({size}, {size}) covariance matrix, not {noise!r}"
            ) from None
    matrix = weight_matrix(noise, size, name)  # pyright: ignore[reportArgumentType]
    if definite and np.linalg.eigvalsh(matrix)[0] <= 0:
        raise ValueError(f"{name} must be positive definite, not {noise}: a sensor without noise is not modelled")
    return matrix


def bound_pair(bounds: tuple, size: int, name: str, *, infinite: bool = False) -> tuple[np.ndarray, np.ndarray]:
    """Lower and upper bounds, each (size,), from a pair of numbers or of vectors; they must ascend.

    They must be finite, or with ``infinite`` may be infinite where there is no bound.
    """
    try:
        sides = [np.asarray(side) for side in bounds]
        if any(side.dtype.kind not in "fiu" for side in sides):
            raise TypeError
        lower, upper = (np.broadcast_to(side.astype(float), (size,)).copy() for side in sides)
    except (TypeError, ValueError):
        raise ValueError(
            f"{name} is a pair (lower, upper) of numbers or of {size} numbers each, not {bounds!r}"
        ) from None
    if not infinite and not (np.isfinite(lower).all() and np.isfinite(upper).all()):
        raise ValueError(f"{name} must be finite, not {bounds}")
    if np.isnan(lower).any() or np.isnan(upper).any():
        raise ValueError(f"{name} must be finite, or infinite where there is no bound, not {bounds}")
    if (lower >= upper).any():
        i = int(np.argmax(lower >= upper))
        raise ValueError(f"{name} cross: lower {lower[i]:g} is not below upper {upper[i]:g}")
    return lower, upper
