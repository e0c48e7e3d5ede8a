"""What settings of methods may be."""

from numbers import Real
from typing import Any


def check_least(least: float, **settings: Any) -> None:
    """Raises ValueError if a setting is no number of at least so much."""
    for name, value in settings.items():
        if not isinstance(value, Real) or not float(value) >= least:
            raise ValueError(f"{name} is at least {least:g}, not {value!r}")
