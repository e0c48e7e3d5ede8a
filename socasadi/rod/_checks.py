from collections.abc import Callable
from math import isfinite, nan
from numbers import Integral
from typing import Any, SupportsFloat, TypeAlias

import casadi as ca
import numpy as np

Number: TypeAlias = float | ca.SX
"""A number, or an expression of the symbols that a rod has as parameters."""


def finite(owner: str, **values: Any) -> None:
    """ValueError unless every value is a finite number, or symbolic."""
    _demand(owner, values, lambda value: True, "a finite number")


def positive(owner: str, **values: Any) -> None:
    """ValueError unless every value is a finite number above zero, or symbolic."""
    _demand(owner, values, lambda value: value > 0, "a finite number above zero")


def positive_number(owner: str, **values: Any) -> None:
    """ValueError unless every value is a finite number above zero; a symbol is not."""
    for name, value in values.items():
        if symbolic(value):
            raise ValueError(f"{owner}: {name} is the expression {value}, but must be a finite number above zero")
    positive(owner, **values)


def flag(owner: str, **values: Any) -> None:
    """TypeError unless every value is True or False."""
    for name, value in values.items():
        if not isinstance(value, bool | np.bool_):
            raise TypeError(f"{owner}: {name} is {value!r}, but must be True or False")


def not_negative(owner: str, **values: Any) -> None:
    """ValueError unless every value is a finite number, zero or above, or symbolic."""
    _demand(owner, values, lambda value: value >= 0, "a finite number, zero or above")


def whole(owner: str, name: str, value: Any, least: int) -> int:
    """``value`` as an int; ValueError unless it is a whole number, ``least`` or above."""
    if isinstance(value, bool) or not isinstance(value, Integral) or value < least:
        raise ValueError(f"{owner}: {name} is {value!r}, but must be a whole number, {least} or above")
    return int(value)


def symbolic(value: Any) -> bool:
    """Whether ``value`` is, or holds, an expression of CasADi symbols."""
    if isinstance(value, list | tuple):
        return any(symbolic(item) for item in value)
    return isinstance(value, ca.SX) and not value.is_constant()


def vector(owner: str, name: str, value: object, size: int) -> np.ndarray:
    """``value`` as a float array (size,); ValueError when its shape is another or an entry is not finite."""
    return _array(owner, name, value, (size,))


def numbers(owner: str, name: str, value: Any, size: int) -> tuple[Any, ...]:
    """``value`` as a tuple of ``size`` finite numbers or symbolic expressions: what a frozen dataclass keeps."""
    if isinstance(value, ca.SX):
        value = [entry if symbolic(entry) else float(entry) for entry in ca.vertsplit(ca.vec(value))]
    if symbolic(value):
        if len(value) != size:
            raise ValueError(f"{owner}: {name} has {len(value)} entries, but must have {size}")
        finite(owner, **{f"{name}[{i}]": entry for i, entry in enumerate(value)})
        return tuple(value)
    return tuple(vector(owner, name, value, size).tolist())


def matrix(owner: str, name: str, value: Any, size: int) -> tuple[tuple[Any, ...], ...]:
    """``value`` as ``size`` rows of ``size`` finite numbers or symbolic expressions; a vector is the diagonal."""
    if isinstance(value, ca.SX):
        value = [row.T for row in ca.vertsplit(value)] if value.shape[1] > 1 else ca.vertsplit(value)
    rows = isinstance(value, list | tuple | np.ndarray) and len(value) == size
    nested = rows and [isinstance(row, list | tuple | np.ndarray) or ca.SX(row).numel() > 1 for row in value]
    if nested and all(nested):
        return tuple(numbers(owner, f"{name}[{i}]", row, size) for i, row in enumerate(value))
    if nested and not any(nested):
        diagonal = numbers(owner, name, value, size)
        return tuple(tuple(diagonal[i] if i == j else 0.0 for j in range(size)) for i in range(size))
    return tuple(map(tuple, _array(owner, name, value, (size, size)).tolist()))


def symmetric(owner: str, name: str, value: Any, size: int, *, definite: bool) -> tuple[tuple[Any, ...], ...]:
    """Like :func:`matrix`; ValueError unless symmetric positive definite (semidefinite), as far as it is numbers."""
    rows = matrix(owner, name, value, size)
    if not symbolic(rows):
        array = np.array(rows)
        smallest, largest = np.linalg.eigvalsh((array + array.T) / 2)[[0, -1]]
        least = 1e-14 * largest if definite else -1e-12 * max(largest, 0.0)
        if not np.allclose(array, array.T, rtol=1e-9, atol=0) or smallest < least or (definite and largest <= 0):
            kind = "definite" if definite else "semidefinite"
            raise ValueError(f"{owner}: {name} is {array.tolist()}, but must be symmetric positive {kind}")
    return rows


def _array(owner: str, name: str, value: object, shape: tuple[int, ...]) -> np.ndarray:
    count = " x ".join(map(str, shape))
    try:
        array = np.asarray(value, dtype=float)
    except (TypeError, ValueError, RuntimeError):
        raise ValueError(f"{owner}: {name} is {value!r}, but must be {count} numbers") from None
    if array.ndim == 0:
        raise ValueError(f"{owner}: {name} is {value!r}, but must be {count} numbers")
    if array.shape != shape:
        raise ValueError(f"{owner}: {name} has shape {array.shape}, but must have shape {shape}")
    if not np.isfinite(array).all():
        raise ValueError(f"{owner}: {name} is {array.tolist()}, but must be finite")
    return array


def _demand(owner: str, values: dict[str, Any], holds: Callable[[Any], bool], what: str) -> None:
    for name, value in values.items():
        if symbolic(value):
            continue
        if not (isfinite(_number(value)) and holds(value)):
            raise ValueError(f"{owner}: {name} is {value!r}, but must be {what}")


def _number(value: Any) -> float:
    """``value`` as a float; NaN for what is no number."""
    if not isinstance(value, SupportsFloat) or isinstance(value, bool):
        return nan
    try:
        return float(value)
    except (TypeError, ValueError, RuntimeError, NotImplementedError):  # a CasADi MX has a float that fails
        return nan
