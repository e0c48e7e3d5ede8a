import functools
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, replace
from numbers import Integral
from typing import NamedTuple, Self

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from ._entry import Entry


class StateSpace(NamedTuple):
    """Discrete-time linear model x+ = A x + B u, y = C x + D u, where u is the input held while y came about.

    Fields are arrays, or CasADi matrices where the model is symbolic: A (n, n), B (n, m), C (p, n), D (p, m).
    """

    A: np.ndarray
    B: np.ndarray
    C: np.ndarray
    D: np.ndarray


@dataclass(frozen=True)
class PredictionModel(ABC):
    """A family of linear prediction models, one for each theta.

    Subclasses say which numbers theta holds (:meth:`_default_entries`) and how they make a state-space model
    (:meth:`_matrices`).

    Parameters
    ----------
    axes
        Number p of measured outputs, m.
    inputs
        Number m of tensions, N.
    bounds
        One (lower, upper) pair an entry of theta, in the units of the entries; None for the family's own.
        :func:`bounds_from_record` and the families' ``from_spec`` make them.

    Raises
    ------
    ValueError
        A count is not a positive integer, or the bounds are of another number than theta or cross.
    """

    axes: int = 2
    inputs: int = 3
    bounds: tuple[tuple[float, float], ...] | None = None

    def __post_init__(self) -> None:
        for name in ("axes", "inputs"):
            value = getattr(self, name)
            if not isinstance(value, Integral) or value < 1:
                raise ValueError(f"{name} of {type(self).__name__} is a positive integer, not {value!r}")
        if self.bounds is not None:
            object.__setattr__(self, "bounds", _pairs(self.bounds))
        _ = self.entries

    @property
    @abstractmethod
    def order(self) -> int:
        """Number of states."""

    @abstractmethod
    def _default_entries(self) -> tuple[Entry, ...]: ...

    @abstractmethod
    def _matrices(self, theta: ca.SX, sample_time: float) -> tuple[ca.SX, ...]: ...

    @functools.cached_property
    def entries(self) -> tuple[Entry, ...]:
        """The entries of theta in their order, with name, unit, bounds and scale."""
        own = self._default_entries()
        if self.bounds is None:
            return own
        if len(self.bounds) != len(own):
            raise ValueError(
                f"bounds hold {len(self.bounds)} pairs, but theta of this {type(self).__name__} has {len(own)} entries"
            )
        return tuple(
            replace(entry, lower=lower, upper=upper) for entry, (lower, upper) in zip(own, self.bounds, strict=True)
        )

    @property
    def size(self) -> int:
        """Number of entries of theta."""
        return len(self.entries)

    def with_bounds(self, bounds: Sequence[tuple[float, float]]) -> Self:
        """The same family searched in another box."""
        return replace(self, bounds=_pairs(bounds))

    def check(self, theta: ArrayLike) -> np.ndarray:
        """``theta`` as floats (size,); ValueError when its shape is another or an entry is not finite."""
        values = np.asarray(theta, dtype=float)
        if values.shape != (self.size,):
            raise ValueError(f"theta has shape {values.shape}; this {type(self).__name__} takes ({self.size},)")
        if not np.isfinite(values).all():
            entry = self.entries[int(np.argmin(np.isfinite(values)))]
            raise ValueError(f"theta must be finite, but {entry.name} is {values[np.argmin(np.isfinite(values))]}")
        return values

    @functools.lru_cache(maxsize=32)  # noqa: B019 (a family is a small value; building its Function costs a millisecond)
    def matrices(self, sample_time: float) -> ca.Function:
        """CasADi Function theta (size,) -> A, B, C, D of the model sampled at ``sample_time`` s."""
        if not (np.isfinite(sample_time) and sample_time > 0):
            raise ValueError(f"sample_time must be positive, not {sample_time} s")
        theta = ca.SX.sym("theta", self.size)  # pyright: ignore[reportArgumentType]
        outputs = [ca.densify(matrix) for matrix in self._matrices(theta, float(sample_time))]
        return ca.Function("matrices", [theta], outputs, ["theta"], ["A", "B", "C", "D"])

    def state_space(self, theta: ArrayLike, sample_time: float) -> StateSpace:
        """The model of one theta as arrays."""
        return StateSpace(*(np.asarray(m.full()) for m in self.matrices(sample_time)(self.check(theta))))


def _pairs(bounds: Sequence[Sequence[float]] | np.ndarray) -> tuple[tuple[float, float], ...]:
    try:
        return tuple((float(lower), float(upper)) for lower, upper in bounds)
    except (TypeError, ValueError):
        raise ValueError(f"bounds hold one pair (lower, upper) of numbers an entry of theta, not {bounds}") from None
