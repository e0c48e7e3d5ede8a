from collections.abc import Iterable, Sequence

import numpy as np
from threadpoolctl import threadpool_limits

from ._base import StateSpace
from ._identify import state_space_error
from ._record import Record

_ORDERS = range(2, 11)
_WINDOW = 20
"""Samples of past and future whose relation the model is read from."""
_HELD_OUT = 0.3
"""Share of the record, its end, on which orders are compared."""


def subspace(record: Record, order: int | None = None, *, flights: Iterable[Record] = ()) -> StateSpace:
    """The stable model that N4SID finds in a record.

    Van Overschee, De Moor, "N4SID: subspace algorithms for the identification of combined deterministic-stochastic
    systems", Automatica 30, 1994, as the package sippy_unipi has it; the inputs' matrix B is then fitted to the whole
    record, simulated from its start, which is linear least squares and makes the gain at rest more exact. Unlike
    :func:`identify` it needs no family of models, and no bounds; some 40 s of a record like :func:`probe`'s are enough
    for an arm of a few modes.

    Parameters
    ----------
    record
        Of a probing that moves every input by itself.
    order
        Number of states. None: of the orders 2 to 10 the one that, fitted to the first seven tenths of the record,
        predicts the rest best.
    flights
        Further records, such as of a few flights with the controller that the model alone has given: B is fitted to
        them as well, so that the model's gains are those of the motion that is wanted. Nothing but the inputs may have
        moved the robot: no pulse, no hand.

    Raises
    ------
    ModuleNotFoundError
        The package sippy_unipi is not installed.
    ValueError
        The record is too short, or a flight has another sample time or other numbers of inputs or outputs.
    """
    least = 4 * _WINDOW + max(_ORDERS)
    if len(record.tension) < least / (1 - _HELD_OUT):
        raise ValueError(f"the record has {len(record.tension)} samples; {least / (1 - _HELD_OUT):.0f} are needed")
    flights = list(flights)
    for number, flight in enumerate(flights):
        _check_alike(record, flight, number)
    with threadpool_limits(1):  # its matrices are small: threads would wait for each other
        return _n4sid(record, _best_order(record) if order is None else order, flights)


def _check_alike(record: Record, flight: Record, number: int) -> None:
    for name, ours, theirs in (
        ("inputs", record.tension.shape[1], flight.tension.shape[1]),
        ("outputs", record.output.shape[1], flight.output.shape[1]),
        ("sample_time", record.sample_time, flight.sample_time),
    ):
        if not np.isclose(ours, theirs, rtol=1e-9):
            raise ValueError(f"{name} of flight {number} is {theirs}, but {ours} of the record: records of one robot")


def _best_order(record: Record) -> int:
    kept = round((1 - _HELD_OUT) * len(record.tension))
    first = Record(record.sample_time, record.tension[:kept], record.output[: kept + 1])
    last = Record(record.sample_time, record.tension[kept:], record.output[kept:])
    return min(_ORDERS, key=lambda order: state_space_error(_n4sid(first, order), last))


def _n4sid(record: Record, order: int, flights: Sequence[Record] = ()) -> StateSpace:
    try:
        import sippy_unipi  # an extra, which takes its time
    except ModuleNotFoundError as error:
        raise ModuleNotFoundError(
            f"subspace identification needs the package sippy_unipi ({error}): pip install 'socasadi[identification]'"
        ) from error
    # In theirs y_k = C x_k comes before u_k, in ours after: the same, with the index of y moved by one.
    found = sippy_unipi.system_identification(
        record.output[:-1].T,
        record.tension.T,
        "N4SID",
        SS_f=_WINDOW,
        SS_p=_WINDOW,
        SS_fixed_order=order,
        SS_A_stability=True,
    )
    A, C = (np.asarray(getattr(found, name), dtype=float) for name in "AC")
    return StateSpace(A, _input_matrix(A, C, [record, *flights]), C, np.zeros((len(C), record.tension.shape[1])))


def _input_matrix(A: np.ndarray, C: np.ndarray, records: Sequence[Record]) -> np.ndarray:
    """B (n, m) with which the model, simulated over whole records, is the least off; their first states are free."""
    n, m = len(A), records[0].tension.shape[1]
    rows, wanted = [], []
    for number, record in enumerate(records):
        # Columns: what each entry of B alone would give, column by column of B, and each record's first states.
        by_entry, by_state = _answers(A, C, record)
        first = np.zeros((len(by_state), n * len(records)))
        first[:, n * number : n * (number + 1)] = by_state
        rows.append(np.hstack([by_entry, first]))
        wanted.append(record.output[1:].ravel())
    fitted = np.linalg.lstsq(np.vstack(rows), np.concatenate(wanted), rcond=1e-12)[0]
    return fitted[: n * m].reshape(m, n).T


def _answers(A: np.ndarray, C: np.ndarray, record: Record) -> tuple[np.ndarray, np.ndarray]:
    """Outputs over a record, sample by sample, that each entry of B gives (N p, n m) and each first state (N p, n)."""
    (samples, m), n, p = record.tension.shape, len(A), len(C)
    states, rows = np.hstack([np.zeros((n, n * m)), np.eye(n)]), np.zeros((samples, p, n * (m + 1)))
    for t, u in enumerate(record.tension):
        states = A @ states
        states[:, : n * m] += np.kron(u, np.eye(n))
        rows[t] = C @ states
    by_entry, by_state = np.split(rows.reshape(samples * p, -1), [n * m], axis=1)
    return by_entry, by_state
