from collections.abc import Sequence
from math import isfinite
from typing import SupportsFloat

import numpy as np


def finite(owner: str, **values: float) -> None:
    """ValueError unless every value is a finite number."""
    for name, value in values.items():
        if not (_is_number(value) and isfinite(value)):
            raise ValueError(f"{owner}: {name} is {value!r}, but must be a finite number")


def positive(owner: str, **values: float) -> None:
    """ValueError unless every value is a finite number above zero."""
    for name, value in values.items():
        if not (_is_number(value) and isfinite(value) and value > 0):
            raise ValueError(f"{owner}: {name} is {value!r}, but must be a finite number above zero")


def not_negative(owner: str, **values: float) -> None:
    """ValueError unless every value is a finite number, zero or above."""
    for name, value in values.items():
        if not (_is_number(value) and isfinite(value) and value >= 0):
            raise ValueError(f"{owner}: {name} is {value!r}, but must be a finite number, zero or above")


def vector(owner: str, name: str, value: object, size: int) -> np.ndarray:
    """``value`` as a float array (size,); ValueError when its shape is another or an entry is not finite."""
    try:
        array = np.asarray(value, dtype=float)
    except (TypeError, ValueError):
        raise ValueError(f"{owner}: {name} is {value!r}, but must be {size} numbers") from None
    if array.shape != (size,):
        raise ValueError(f"{owner}: {name} has shape {array.shape}, but must have shape ({size},)")
    if not np.isfinite(array).all():
        raise ValueError(f"{owner}: {name} is {array.tolist()}, but must be finite")
    return array


def numbers(owner: str, name: str, value: Sequence[float], size: int) -> tuple[float, ...]:
    """Like :func:`vector`, as a tuple: what a frozen dataclass keeps."""
    return tuple(vector(owner, name, value, size).tolist())


def _is_number(value: object) -> bool:
    return isinstance(value, SupportsFloat) and not isinstance(value, bool)
