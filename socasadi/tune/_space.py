"""The box that is searched: named, bounded, scaled parameters, and its map to the unit cube."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

SCALES = ("linear", "log")


class ParameterLike(Protocol):
    """Anything with these five attributes is a parameter: no class has to be inherited.

    `lower` and `upper` are finite and in `unit`; `scale` is "linear" or "log" (then both bounds are
    positive).
    """

    @property
    def name(self) -> str: ...
    @property
    def unit(self) -> str: ...
    @property
    def lower(self) -> float: ...
    @property
    def upper(self) -> float: ...
    @property
    def scale(self) -> str: ...


@dataclass(frozen=True)
class Parameter:
    """One entry of theta.

    Parameters
    ----------
    name : str
        Unique within its `Space`.
    unit : str
        SI unit as it is printed, "" when there is none.
    lower, upper : float
        Bounds in that unit, lower < upper.
    scale : {"linear", "log"}
        "log" searches the logarithm: for entries that are scales (frequencies, damping ratios), bounds
        positive.

    Raises
    ------
    ValueError
        Bounds that cross, are not finite, or are not positive on a log scale; an unknown scale.
    """

    name: str
    unit: str
    lower: float
    upper: float
    scale: Literal["linear", "log"] = "linear"

    def __post_init__(self) -> None:
        check_parameter(self)


def check_parameter(parameter: ParameterLike) -> None:
    """Raise ValueError with one sentence when the parameter makes no sense."""
    name, lower, upper = parameter.name, parameter.lower, parameter.upper
    if not name:
        raise ValueError("a parameter has an empty name: name it")
    if parameter.scale not in SCALES:
        raise ValueError(f"parameter {name!r} has scale {parameter.scale!r}; known are {', '.join(SCALES)}")
    if not (math.isfinite(lower) and math.isfinite(upper)):
        raise ValueError(f"parameter {name!r} has bounds [{lower}, {upper}]: give two finite numbers")
    if not lower < upper:
        raise ValueError(f"parameter {name!r} has bounds [{lower}, {upper}]: lower must be below upper")
    if parameter.scale == "log" and lower <= 0:
        raise ValueError(f"parameter {name!r} has a log scale and the lower bound {lower}: it must be positive")


class Space:
    """The box of all theta, as an ordered list of parameters.

    Parameters
    ----------
    parameters : sequence of ParameterLike
        Objects with `name`, `unit`, `lower`, `upper` and `scale`, for instance `Parameter`.

    Attributes
    ----------
    parameters : tuple of ParameterLike
    names : tuple of str
    dimension : int
    lower, upper : ndarray (d,)
        Bounds, in each parameter's own unit; read-only.

    Raises
    ------
    ValueError
        No parameter, a name that stands twice, or a parameter that makes no sense (see `Parameter`).
    """

    def __init__(self, parameters: Sequence[ParameterLike]) -> None:
        self.parameters = tuple(parameters)
        if not self.parameters:
            raise ValueError("a space needs at least one parameter")
        for parameter in self.parameters:
            check_parameter(parameter)
        self.names = tuple(parameter.name for parameter in self.parameters)
        for name in self.names:
            if self.names.count(name) > 1:
                raise ValueError(f"the name {name!r} stands {self.names.count(name)} times: names are unique")
        self.dimension = len(self.parameters)
        self.lower = np.array([float(parameter.lower) for parameter in self.parameters])
        self.upper = np.array([float(parameter.upper) for parameter in self.parameters])
        self._log = np.array([parameter.scale == "log" for parameter in self.parameters])
        self._low = self._warp(self.lower)
        self._width = self._warp(self.upper) - self._low
        self.lower.setflags(write=False)
        self.upper.setflags(write=False)

    def _warp(self, theta: NDArray) -> NDArray:
        return np.where(self._log, np.log(np.where(self._log, theta, 1.0)), theta)

    def __len__(self) -> int:
        return self.dimension

    def __repr__(self) -> str:
        return f"Space({', '.join(self.names)})"

    def check(self, theta: ArrayLike) -> NDArray:
        """Return theta (d,) as a new float array, or raise ValueError naming the entry that is wrong.

        Raises
        ------
        ValueError
            Wrong shape, an entry that is not a finite number, or an entry outside its bounds.
        """
        try:
            values = np.array(theta, dtype=float)
        except (TypeError, ValueError) as error:
            raise ValueError(f"theta must be {self.dimension} numbers, not {theta!r}") from error
        if values.shape != (self.dimension,):
            raise ValueError(
                f"theta has shape {values.shape}; it must be ({self.dimension},), one number for each of "
                f"{', '.join(self.names)}"
            )
        for i, (value, parameter) in enumerate(zip(values, self.parameters, strict=True)):
            if not np.isfinite(value):
                raise ValueError(f"theta[{i}] ({parameter.name}) is {value}: it must be a finite number")
            if not self.lower[i] <= value <= self.upper[i]:
                unit = f" {parameter.unit}" if parameter.unit else ""
                raise ValueError(
                    f"theta[{i}] ({parameter.name}) is {float(value)!r}{unit}, outside its bounds "
                    f"[{parameter.lower!r}, {parameter.upper!r}]: move it inside or widen the bounds"
                )
        return values

    def to_unit(self, theta: ArrayLike) -> NDArray:
        """Map theta (d,) inside the bounds to the unit cube, (d,); raises as `check` does."""
        return np.clip((self._warp(self.check(theta)) - self._low) / self._width, 0.0, 1.0)

    def from_unit(self, unit: ArrayLike) -> NDArray:
        """Map a point (d,) of the unit cube to theta (d,); what lies outside the cube lands on its bound."""
        unit = np.asarray(unit, dtype=float)
        warped = self._low + self._width * np.clip(unit, 0.0, 1.0)
        theta = np.where(self._log, np.exp(np.where(self._log, warped, 0.0)), warped)
        # exp(log(bound)) misses the bound by a rounding error, and `check` must accept every result.
        theta = np.clip(theta, self.lower, self.upper)
        return np.where(unit <= 0.0, self.lower, np.where(unit >= 1.0, self.upper, theta))
