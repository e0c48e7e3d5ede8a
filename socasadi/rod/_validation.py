"""What must hold of a rod as a whole, said in one sentence where it does not."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import casadi as ca
import numpy as np

from ._checks import matrix, symbolic
from ._symbols import symbols_in
from .body import Division

if TYPE_CHECKING:
    from ._rod import Rod

PLACE_TOLERANCE = 1e-9
"""Of the rod's length: two places nearer than this are one."""

_LOOKED_AT = 21  # places of a cable in each division


def one_or_several(divisions: Sequence[Division] | Division, given: dict[str, Any]) -> tuple[Division, ...]:
    """The divisions of a rod, from ``divisions`` and what is given in their place or beside them."""
    several = all_of("divisions", divisions, (Division,))
    if several:
        if "length" in given and len(several) > 1:
            raise ValueError(
                f"Rod: length is {given['length']!r} m beside {len(several)} divisions, each of which has its own"
            )
        return tuple(replace(division, **given) for division in several)
    missing = [name for name in ("length", "section", "material", "strain") if name not in given]
    if missing:
        raise ValueError(f"Rod: {', '.join(missing)} not given; a rod has them, or divisions that have them")
    return (Division(**given),)


def all_of(name: str, things: Any, kinds: tuple[type, ...]) -> tuple[Any, ...]:
    """``things`` as a tuple; TypeError when one is of another kind."""
    wanted = " or a ".join(kind.__name__ for kind in kinds)
    try:
        several = (things,) if isinstance(things, kinds) else tuple(things)
    except Exception as error:
        raise TypeError(f"Rod: {name} is {things!r}, but must hold each a {wanted}") from error
    for i, thing in enumerate(several):
        if not isinstance(thing, kinds):
            raise TypeError(f"Rod: {name}[{i}] is {thing!r}, but must be a {wanted}")
    return several


def rotation(value: Any) -> tuple[tuple[float, ...], ...]:
    try:
        array = np.asarray(value, dtype=float)
    except (TypeError, ValueError, RuntimeError):
        array = np.zeros(0)
    if array.shape != (3, 3) or not _is_rotation(array):
        given = value.tolist() if isinstance(value, np.ndarray) else value
        raise ValueError(
            f"Rod: base_rotation is {given!r}, but must be a rotation matrix (3, 3): orthonormal, right-handed"
        )
    return matrix("Rod", "base_rotation", array, 3)


def _is_rotation(matrix: np.ndarray) -> bool:
    return np.allclose(matrix.T @ matrix, np.eye(3), atol=1e-9) and np.linalg.det(matrix) > 0


def check_places(rod: Rod) -> None:
    """ValueError when something lies beyond the tip, or begins there."""
    for name, things in (("payloads", rod.payloads), ("loads", rod.loads), ("cables", rod.cables)):
        for i, thing in enumerate(things):
            for what in ("s", "start", "end"):
                s = getattr(thing, what, None)
                if s is not None and s > rod.length * (1 + PLACE_TOLERANCE):
                    raise ValueError(f"Rod: {what} of {name}[{i}] is {s!r} m, beyond the tip at {rod.length:g} m")
            start = getattr(thing, "start", 0.0)
            if start >= rod.length * (1 - PLACE_TOLERANCE):
                raise ValueError(f"Rod: start of {name}[{i}] is {start!r} m, where the rod ends: nothing is left of it")


def check_symbols(rod: Rod) -> None:
    """ValueError when something is written with a symbol that is not among the parameters."""
    for i, symbol in enumerate(rod.parameters):
        if not symbol.is_symbolic():
            raise ValueError(f"Rod: parameters holds {symbol}, but must hold CasADi SX symbols")
        if any(ca.is_equal(symbol, other) for other in rod.parameters[:i]):
            raise ValueError(f"Rod: parameters holds the symbol {symbol} twice")
    for part in (rod.divisions, rod.cables, rod.gravity, rod.payloads, rod.loads, rod.drag):
        for symbol in symbols_in(part):
            if not any(ca.is_equal(symbol, parameter) for parameter in rod.parameters):
                raise ValueError(f"Rod: the symbol {symbol} is used but not among parameters; add it there")


def warn_of_cables_outside(rod: Rod) -> None:
    """One warning when a cable runs outside the section."""
    start = 0.0
    for division in rod.divisions:
        for i, cable in enumerate(rod.cables):
            a = max(start, cable.start)
            b = min(start + division.length, rod.length if cable.end is None else cable.end)
            for s in np.linspace(a, b, _LOOKED_AT).tolist() if a < b else []:
                section = division.section_at((s - start) / division.length)
                y, z = cable.at(s)
                if symbolic((y, z)) or section.contains(float(y), float(z)):
                    continue
                y_half, z_half = (float(half) for half in section.half_widths or (0, 0))
                warnings.warn(
                    f"Rod: cable {i} runs at (y, z) = ({float(y):g}, {float(z):g}) m at s = {s:g} m, outside the "
                    f"section, which reaches to ({y_half:g}, {z_half:g}) m; that is right only if discs carry it",
                    stacklevel=4,
                )
                return
        start += division.length
