from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ..campaign import Pilot
from ..model import Record, StateSpace, state_space_error
from ..mpc import DesignError
from ._lab import Lab
from ._method import Method, needed

_ORDERS = range(2, 11)
_WINDOW = 20
"""Samples of past and future whose relation the model is read from."""
_HELD_OUT = 0.3
"""Share of the record, its end, on which orders are compared."""


@dataclass(frozen=True)
class Subspace(Method):
    """The study's MPC on a state-space model by N4SID, of the order that predicts the end of the record best.

    Van Overschee, De Moor, "N4SID: subspace algorithms for the identification of combined deterministic-stochastic
    systems", Automatica 30, 1994, as the package sippy_unipi has it.

    Parameters
    ----------
    probing
        s of probing.
    """

    probing: float = 40.0

    def offers(self, lab: Lab) -> Iterator[Pilot]:
        record = lab.probe(self.probing)
        kept = round((1 - _HELD_OUT) * len(record.tension))
        first = Record(record.sample_time, record.tension[:kept], record.output[: kept + 1])
        last = Record(record.sample_time, record.tension[kept:], record.output[kept:])
        errors = {order: state_space_error(n4sid(first, order), last) for order in _ORDERS}
        for order in sorted(errors, key=lambda order: errors[order]):
            try:
                pilot = lab.study.mpc.controller_for(n4sid(record, order))
            except DesignError:
                continue
            yield pilot
            return


def n4sid(record: Record, order: int) -> StateSpace:
    """The stable model of an order that N4SID finds in a record.

    Raises
    ------
    ModuleNotFoundError
        The package sippy_unipi is not installed.
    """
    sippy = needed("sippy_unipi", "subspace identification")
    # In theirs y_k = C x_k comes before u_k, in ours after: the same, with the index of y moved by one.
    found = sippy.system_identification(
        record.output[:-1].T,
        record.tension.T,
        "N4SID",
        SS_f=_WINDOW,
        SS_p=_WINDOW,
        SS_fixed_order=order,
        SS_A_stability=True,
    )
    A, B, C = (np.asarray(getattr(found, name), dtype=float) for name in "ABC")
    return StateSpace(A, B, C, np.zeros((len(C), B.shape[1])))
