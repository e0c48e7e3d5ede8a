"""The symbols in a description: which there are, and numbers in their place."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields, is_dataclass, replace
from typing import Any

import casadi as ca

_PLACES = (0.0, 0.1, 0.3, 0.5, 0.8, 1.0)  # at which a function of the arc length is asked for its symbols


def symbols_in(value: Any) -> list[ca.SX]:
    """The distinct symbols that ``value`` is written with, however deep in dataclasses, tuples and functions."""
    return ca.symvar(ca.veccat(ca.SX(0, 1), *_expressions(value)))


def with_numbers(value: Any, symbols: ca.SX, numbers: ca.DM) -> Any:
    """``value`` with ``numbers`` in the place of ``symbols``; what has none of them is left as it is."""
    if not symbols_in(value):
        return value
    if isinstance(value, ca.SX):
        number = ca.substitute(value, symbols, numbers)
        return float(number) if number.is_scalar() and number.is_constant() else number
    if isinstance(value, tuple):
        return tuple(with_numbers(item, symbols, numbers) for item in value)
    if is_dataclass(value) and not isinstance(value, type):
        changes = {f.name: with_numbers(getattr(value, f.name), symbols, numbers) for f in fields(value) if f.init}
        return replace(value, **changes)
    return _Evaluated(value, symbols, numbers)


class _Evaluated:
    """A function of the arc length whose result is written with symbols, with numbers in their place."""

    def __init__(self, function: Callable[[Any], Any], symbols: ca.SX, numbers: ca.DM) -> None:
        self._function, self._symbols, self._numbers = function, symbols, numbers

    def __call__(self, place: Any) -> Any:
        return with_numbers(self._function(place), self._symbols, self._numbers)


def _expressions(value: Any) -> list[ca.SX]:
    if isinstance(value, ca.SX):
        return [value]
    if isinstance(value, tuple | list):
        return [found for item in value for found in _expressions(item)]
    if is_dataclass(value) and not isinstance(value, type):
        return [found for f in fields(value) if f.init for found in _expressions(getattr(value, f.name))]
    if callable(value) and not isinstance(value, type):
        return [found for place in _PLACES for found in _expressions(_tried(value, place))]
    return []


def _tried(function: Callable[[Any], Any], place: float) -> Any:
    """What a function gives at a place: some take a number, some an expression; what is wrong with it shows later."""
    for argument in (place, ca.SX(place)):
        try:
            return function(argument)
        except Exception:
            continue
    return None
