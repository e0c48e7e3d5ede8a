from dataclasses import dataclass
from typing import Self

import casadi as ca
import numpy as np

from ._base import PredictionModel, StateSpace
from ._entry import Entry

Matrix = tuple[tuple[float, ...], ...]


@dataclass(frozen=True)
class Fixed(PredictionModel):
    """One model, with nothing open: theta has no entries of it, and holds what an MPC tunes beside its model.

    For a model that is known or was identified, by :func:`subspace` for instance; :meth:`of` makes one.

    Parameters
    ----------
    A, B, C, D
        Rows of the matrices of a :class:`StateSpace`.
    sample_time
        Of that model, s.

    Raises
    ------
    ValueError
        The matrices do not fit each other.

    Examples
    --------
    >>> import numpy as np
    >>> Fixed.of(StateSpace(0.5 * np.eye(2), np.ones((2, 3)), np.eye(2), np.zeros((2, 3))), sample_time=0.05).size
    0
    """

    A: Matrix = ()
    B: Matrix = ()
    C: Matrix = ()
    D: Matrix = ()
    sample_time: float = 0.05

    def __post_init__(self) -> None:
        for name in "ABCD":
            rows = np.atleast_2d(np.asarray(getattr(self, name), dtype=float))
            object.__setattr__(self, name, tuple(map(tuple, rows.tolist())))
        n, m, p = len(self.A), self.inputs, self.axes
        for name, wanted in {"A": (n, n), "B": (n, m), "C": (p, n), "D": (p, m)}.items():
            found = np.shape(getattr(self, name))
            if found != wanted:
                raise ValueError(
                    f"{name} of a fixed model has shape {found}; {wanted} fits {n} states, {m} inputs, {p} outputs"
                )
            if not np.isfinite(getattr(self, name)).all():
                raise ValueError(f"{name} of a fixed model is not finite")
        super().__post_init__()

    @classmethod
    def of(cls, system: StateSpace, sample_time: float) -> Self:
        """The family of ``system`` alone, which is sampled every ``sample_time`` s."""
        p, m = np.shape(system.D)
        return cls(p, m, None, *system, sample_time)  # pyright: ignore[reportArgumentType]

    @property
    def order(self) -> int:
        return len(self.A)

    def _default_entries(self) -> tuple[Entry, ...]:
        return ()

    def _matrices(self, theta: ca.SX, sample_time: float) -> tuple[ca.SX, ...]:
        if not np.isclose(sample_time, self.sample_time, rtol=1e-9):
            raise ValueError(f"the fixed model is sampled every {self.sample_time:g} s, not every {sample_time:g} s")
        return tuple(ca.SX(ca.DM(np.array(getattr(self, name)))) for name in "ABCD")
