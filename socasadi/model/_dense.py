import warnings
from dataclasses import dataclass
from numbers import Integral

import casadi as ca

from ._base import PredictionModel
from ._entry import Entry


@dataclass(frozen=True)
class Dense(PredictionModel):
    r"""The paper's model: entries of A, B, C and optionally D, in a form that has no redundant directions.

    A state-space model of order n has :math:`n^2` directions (the choice of coordinates) that change theta and not the
    model. They are fixed by the observable pseudo-canonical form (Ljung, System Identification, 2nd ed., section
    4.4, appendix 4A): the states are the outputs and then their rates, so that :math:`C = [I\ 0]` and the first rows
    of A only link outputs to rates. Free are n p entries of A, n m of B and, with ``feedthrough``, p m of D: 10, 15 and
    20 numbers for orders 2, 3 and 4 with two outputs and three inputs.

    The form is written with the forward difference :math:`\delta x = (x_+ - x)/T`: :math:`A = I + T A_\delta`,
    :math:`B = T B_\delta`. Entries are then rates in SI units, hardly move with the sample time T, and
    none sits next to 1. ``Ad`` and ``Bd`` in the entries' names are these matrices; an entry whose name starts with a
    minus enters with that sign, since it restores.

    Parameters
    ----------
    order
        Number of states: between ``axes`` and ``2 * axes`` (2 to 4 for the plane). Only an axis with two states, its
        output and its rate, can swing; with an order of 3 the second axis has none and just lags.
    feedthrough
        Whether D is free; else it is zero.

    Warns
    -----
    UserWarning
        theta has more than 20 entries, beyond what a few dozen experiments can settle.
    """

    order: int = 4
    feedthrough: bool = False

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.size > 20:
            warnings.warn(
                f"theta of this Dense model has {self.size} entries; a few dozen experiments settle at most 20: "
                "lower the order or drop the feedthrough",
                stacklevel=3,
            )

    def _default_entries(self) -> tuple[Entry, ...]:
        if not (isinstance(self.order, Integral) and self.axes <= self.order <= 2 * self.axes):
            raise ValueError(
                f"order of a Dense model with {self.axes} axes lies between {self.axes} and {2 * self.axes}, "
                f"not {self.order!r}"
            )
        rates = self.order - self.axes
        # Row i of A is the equation of motion of an axis: of first order for the axes whose rate is no state.
        entries = [self._motion_entry(i, j) for i in range(rates, self.order) for j in range(self.order)]
        for i in range(self.order):
            unit, bound = ("m/(s2 N)", 0.3) if i >= self.axes else ("m/(s N)", 0.06 if i >= rates else 0.0075)
            entries += [Entry(f"Bd[{i + 1},{j + 1}]", unit, -bound, bound) for j in range(self.inputs)]
        if self.feedthrough:
            places = [(i + 1, j + 1) for i in range(self.axes) for j in range(self.inputs)]
            entries += [Entry(f"D[{i},{j}]", "m/N", -0.003, 0.003) for i, j in places]
        return tuple(entries)

    def _motion_entry(self, row: int, column: int) -> Entry:
        """How the axis of `row` reacts to state `column`: restoring terms are positive, couplings of any sign."""
        first_order, to_rate = row < self.axes, column >= self.axes
        own = column in ({row} if first_order else {row, row - self.axes})
        name = f"Ad[{row + 1},{column + 1}]"
        match first_order, to_rate, own:
            case True, False, True:
                return Entry("-" + name, "1/s", 0.5, 10.0, "log")
            case True, False, False:
                return Entry(name, "1/s", -2.0, 2.0)
            case True, True, _:
                return Entry(name, "1", -1.0, 1.0)
            case False, False, True:
                return Entry("-" + name, "1/s2", 4.0, 100.0, "log")
            case False, False, False:
                return Entry(name, "1/s2", -10.0, 10.0)
            case False, True, True:
                return Entry("-" + name, "1/s", 0.5, 15.0, "log")
            case _:
                return Entry(name, "1/s", -2.0, 2.0)

    def _matrices(self, theta: ca.SX, sample_time: float) -> tuple[ca.SX, ...]:
        n, m, p = self.order, self.inputs, self.axes
        rates = n - p
        sign = ca.DM([-1.0 if entry.name.startswith("-") else 1.0 for entry in self.entries])
        free_A, free_B, free_D = ca.vertsplit(theta * sign, [0, n * p, n * p + n * m, self.size])
        links = ca.horzcat(ca.SX(rates, p), ca.SX.eye(rates))
        A = ca.SX.eye(n) + sample_time * ca.vertcat(links, _rows(free_A, p, n))
        B = sample_time * _rows(free_B, n, m)
        C = ca.horzcat(ca.SX.eye(p), ca.SX(p, rates))
        return A, B, C, _rows(free_D, p, m) if self.feedthrough else ca.SX(p, m)


def _rows(values: ca.SX, rows: int, columns: int) -> ca.SX:
    return ca.reshape(values, columns, rows).T
