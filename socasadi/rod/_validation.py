"""What must hold of a rod as a whole, said in one sentence where it does not."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import casadi as ca
import numpy as np

from ._checks import matrix, symbolic
from .body import DistributedLoad, Division

if TYPE_CHECKING:
    from ._rod import Rod


def one_or_several(divisions: Sequence[Division] | Division, given: dict[str, Any]) -> tuple[Division, ...]:
    """The divisions of a rod, from ``divisions`` and what is given in their place or beside them."""
    several = (divisions,) if isinstance(divisions, Division) else tuple(divisions)
    for i, division in enumerate(several):
        if not isinstance(division, Division):
            raise TypeError(f"Rod: divisions[{i}] is {division!r}, but must be a Division")
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
    if not isinstance(things, (Iterable, *kinds)):
        raise TypeError(f"Rod: {name} is {things!r}, but must hold each a {wanted}")
    several = (things,) if isinstance(things, kinds) else tuple(things)
    for i, thing in enumerate(several):
        if not isinstance(thing, kinds):
            raise TypeError(f"Rod: {name}[{i}] is {thing!r}, but must be a {wanted}")
    return several


def rotation(value: Any) -> tuple[tuple[float, ...], ...]:
    try:
        array = np.asarray(value, dtype=float)
    except (TypeError, ValueError):
        array = np.zeros(0)
    if array.shape != (3, 3) or not _is_rotation(array):
        raise ValueError(
            f"Rod: base_rotation is {value!r}, but must be a rotation matrix (3, 3): orthonormal, right-handed"
        )
    return matrix("Rod", "base_rotation", array, 3)


def _is_rotation(matrix: np.ndarray) -> bool:
    return np.allclose(matrix.T @ matrix, np.eye(3), atol=1e-9) and np.linalg.det(matrix) > 0


def check_places(rod: Rod) -> None:
    """ValueError when something lies beyond the tip."""
    for name, things in (("payloads", rod.payloads), ("loads", rod.loads), ("cables", rod.cables)):
        for i, thing in enumerate(things):
            for what in ("s", "start", "end"):
                s = getattr(thing, what, None)
                if s is not None and s > rod.length * (1 + 1e-9):
                    raise ValueError(f"Rod: {what} of {name}[{i}] is {s!r} m, beyond the tip at {rod.length:g} m")


def check_symbols(rod: Rod) -> None:
    """ValueError when something is written with a symbol that is not among the parameters."""
    for symbol in rod.parameters:
        if not symbol.is_symbolic():
            raise ValueError(f"Rod: parameters holds {symbol}, but must hold CasADi SX symbols")
    written: list[Any] = [*rod.gravity, *rod.base_position]
    for division in rod.divisions:
        written += [*division.inertia_at(0.5), division.stiffness_at(0.5), division.damping_at(0.5)]
        written += [division.strain.rest_at(ca.SX(0.5))]
    for payload in rod.payloads:
        written += [payload.mass, *payload.offset, *(value for row in payload.inertia for value in row)]
    for load in rod.loads:
        written += load.at(load.start) if isinstance(load, DistributedLoad) else (*load.force, *load.moment)
    for cable in rod.cables:
        written += [*cable.at(cable.start), cable.pull, cable.friction, getattr(cable, "stiffness", None) or 0.0]
    if rod.drag is not None:
        written += [*rod.drag.linear, *rod.drag.quadratic, *rod.drag.angular]
    for symbol in ca.symvar(ca.veccat(ca.SX(0, 1), *written)):
        if not any(ca.is_equal(symbol, parameter) for parameter in rod.parameters):
            raise ValueError(f"Rod: the symbol {symbol} is used but not among parameters; add it there")


def warn_of_cables_outside(rod: Rod) -> None:
    start = 0.0
    for division in rod.divisions:
        for i, cable in enumerate(rod.cables):
            end = rod.length if cable.end is None else cable.end
            for x in (0.0, 0.5, 1.0):
                s, section = start + x * division.length, division.section_at(x)
                y, z = cable.at(s) if cable.start <= s <= end else (0.0, 0.0)
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
