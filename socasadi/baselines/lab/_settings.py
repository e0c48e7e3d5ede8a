"""What settings of methods may be."""

from math import isfinite
from numbers import Integral, Real
from typing import Any


def check_least(least: float, **settings: Any) -> None:
    """Raises ValueError if a setting is no finite number of at least so much."""
    for name, value in settings.items():
        if not isinstance(value, Real) or not isfinite(value) or not float(value) >= least:
            raise ValueError(f"{name} is a number of at least {least:g}, not {value!r}")


def check_count(least: int, **settings: Any) -> None:
    """Raises ValueError if a setting is no whole number of at least so much."""
    for name, value in settings.items():
        if not isinstance(value, Integral) or value < least:
            raise ValueError(f"{name} is a whole number of at least {least}, not {value!r}")
