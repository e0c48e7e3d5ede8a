from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Protocol

import casadi as ca
import numpy as np

from .._checks import whole


class Basis(Protocol):
    """Functions of x = s / L, from 0 at the base of a division to 1 at its tip, whose sum a strain is.

    Attributes
    ----------
    size
        How many functions.
    degree
        Of the polynomials between the breaks, or of polynomials that come near them: quadrature goes by it.
    breaks
        Where in (0, 1) a function or one of its derivatives jumps, increasing.
    """

    @property
    def size(self) -> int: ...

    @property
    def degree(self) -> int: ...

    @property
    def breaks(self) -> tuple[float, ...]: ...

    def values(self, x: ca.SX) -> list[ca.SX]:
        """Value of each function at ``x``."""
        ...


@dataclass(frozen=True)
class Legendre:
    """Legendre polynomials P_k(2 x - 1), k = 0 .. ``order``.

    Examples
    --------
    >>> Strain(bending_z=Legendre(2)) == Strain(bending_z=2)
    True
    """

    order: int

    def __post_init__(self) -> None:
        object.__setattr__(self, "order", whole("Legendre", "order", self.order, 0))

    @property
    def size(self) -> int:
        return self.order + 1

    @property
    def degree(self) -> int:
        return self.order

    @property
    def breaks(self) -> tuple[float, ...]:
        return ()

    def values(self, x: ca.SX) -> list[ca.SX]:
        t = 2 * x - 1
        values = [ca.SX(1), t]
        for k in range(1, self.order):
            values.append(((2 * k + 1) * t * values[k] - k * values[k - 1]) / (k + 1))
        return values[: self.size]


@dataclass(frozen=True)
class BSpline:
    """B-splines of ``degree`` on ``pieces`` intervals, clamped at both ends: ``pieces + degree`` functions.

    Degree 0 is piecewise constant strain (PCS), degree 1 the hat functions of piecewise linear strain.
    (Cox-de Boor recursion: de Boor, A Practical Guide to Splines, ch. IX.)

    Parameters
    ----------
    degree
        Of the polynomials, 0 or above; the strain has ``degree - 1`` continuous derivatives.
    pieces
        How many equal intervals, or the inner knots in (0, 1), increasing, where they are not equal.

    Raises
    ------
    ValueError
        A value is out of range.

    Examples
    --------
    >>> BSpline(degree=3, pieces=2).size
    5
    >>> piecewise_constant(4) == BSpline(0, (0.25, 0.5, 0.75))
    True
    """

    degree: int
    pieces: int | tuple[float, ...]

    def __post_init__(self) -> None:
        object.__setattr__(self, "degree", whole("BSpline", "degree", self.degree, 0))
        if isinstance(self.pieces, Sequence | np.ndarray):
            inner = _increasing("BSpline", "pieces", self.pieces)
        else:
            count = whole("BSpline", "pieces", self.pieces, 1)
            inner = tuple(k / count for k in range(1, count))
        object.__setattr__(self, "pieces", inner)

    @property
    def size(self) -> int:
        return len(self.breaks) + 1 + self.degree

    @property
    def breaks(self) -> tuple[float, ...]:
        return self.pieces  # type: ignore[return-value]

    def values(self, x: ca.SX) -> list[ca.SX]:
        knots = [0.0] * (self.degree + 1) + list(self.breaks) + [1.0] * (self.degree + 1)
        inside = [0.0, *self.breaks, 1.0]
        # The first and the last piece reach beyond the ends, so that rounding of x loses no function there.
        above = [ca.SX(1), *(x >= knot for knot in inside[1:-1]), ca.SX(0)]
        values = [ca.SX(0)] * self.degree
        values += [a - b for a, b in pairwise(above)] + [ca.SX(0)] * self.degree
        for k in range(1, self.degree + 1):
            values = [
                _ratio(x - knots[i], knots[i + k] - knots[i]) * values[i]
                + _ratio(knots[i + k + 1] - x, knots[i + k + 1] - knots[i + 1]) * values[i + 1]
                for i in range(len(values) - 1)
            ]
        return values


def piecewise_constant(pieces: int | tuple[float, ...]) -> BSpline:
    """A strain constant on each of ``pieces`` intervals (PCS): ``BSpline(0, pieces)``."""
    return BSpline(0, pieces)


def piecewise_linear(pieces: int | tuple[float, ...]) -> BSpline:
    """A continuous strain linear on each of ``pieces`` intervals (hat functions): ``BSpline(1, pieces)``."""
    return BSpline(1, pieces)


@dataclass(frozen=True)
class UserBasis:
    """A strain basis of one's own.

    Parameters
    ----------
    functions
        Each takes x in [0, 1], a CasADi symbol, and returns an expression of it.
    degree
        Of a polynomial that comes near each of them between the breaks: quadrature goes by it.
    breaks
        Where in (0, 1) a function or its derivative jumps, increasing.

    Examples
    --------
    The first two cosines, for a rod whose curvature is stationary at both ends:

    >>> import casadi as ca
    >>> Strain(bending_z=UserBasis((lambda x: 1, lambda x: ca.cos(ca.pi * x)))).dof
    2
    """

    functions: tuple[Callable[[ca.SX], Any], ...]
    degree: int = 6
    breaks: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        functions = [self.functions] if callable(self.functions) else self.functions
        if not isinstance(functions, list | tuple) or not all(map(callable, functions)):
            raise TypeError(f"UserBasis: functions is {self.functions!r}, but must hold functions of x")
        object.__setattr__(self, "functions", tuple(functions))
        object.__setattr__(self, "degree", whole("UserBasis", "degree", self.degree, 0))
        object.__setattr__(self, "breaks", _increasing("UserBasis", "breaks", self.breaks))
        if not self.functions:
            raise ValueError("UserBasis: there are no functions; give at least one")
        x = ca.SX.sym("x")
        for i, function in enumerate(self.functions):
            try:
                given = function(x)
            except Exception as error:
                raise ValueError(f"UserBasis: function {i} fails on a CasADi symbol: {error}") from error
            value = ca.SX(given) if isinstance(given, float | int | ca.SX) else ca.SX(2, 1)
            right = value.is_scalar() and not [s for s in ca.symvar(value) if not ca.is_equal(s, x)]
            if not right:
                raise ValueError(f"UserBasis: function {i} gives {given}, but must give one expression of x alone")

    @property
    def size(self) -> int:
        return len(self.functions)

    def values(self, x: ca.SX) -> list[ca.SX]:
        return [ca.SX(function(x)) for function in self.functions]


def _increasing(owner: str, name: str, value: Any) -> tuple[float, ...]:
    """``value`` as a tuple of numbers that increase between 0 and 1."""
    try:
        places = tuple(float(x) for x in value)
    except (TypeError, ValueError):
        places = (1.0,)
    if not all(a < b for a, b in pairwise((0.0, *places, 1.0))):
        raise ValueError(f"{owner}: {name} is {value!r}, but must be numbers that increase between 0 and 1")
    return places


def _ratio(numerator: ca.SX, denominator: float) -> ca.SX:
    """The quotient, or zero where knots coincide (there the function that it belongs to is zero)."""
    return numerator / denominator if denominator else ca.SX(0)
