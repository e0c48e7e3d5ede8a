import numpy as np

from ._base import StateSpace
from ._identify import state_space_error
from ._record import Record

_ORDERS = range(2, 11)
_WINDOW = 20
"""Samples of past and future whose relation the model is read from."""
_HELD_OUT = 0.3
"""Share of the record, its end, on which orders are compared."""


def subspace(record: Record, order: int | None = None) -> StateSpace:
    """The stable model that N4SID finds in a record.

    Van Overschee, De Moor, "N4SID: subspace algorithms for the identification of combined deterministic-stochastic
    systems", Automatica 30, 1994, as the package sippy_unipi has it; the inputs' matrix B is then fitted to the whole
    record, simulated from its start, which is linear least squares and makes the gain at rest more exact. Unlike
    :func:`identify` it needs no family of models, and no bounds; some 40 s of a record like :func:`probe`'s are enough
    for an arm of a few modes.

    Parameters
    ----------
    order
        Number of states. None: of the orders 2 to 10 the one that, fitted to the first seven tenths of the record,
        predicts the rest best.

    Raises
    ------
    ModuleNotFoundError
        The package sippy_unipi is not installed.
    ValueError
        The record is too short.
    """
    least = 4 * _WINDOW + max(_ORDERS)
    if len(record.tension) < least / (1 - _HELD_OUT):
        raise ValueError(f"the record has {len(record.tension)} samples; {least / (1 - _HELD_OUT):.0f} are needed")
    if order is not None:
        return _n4sid(record, order)
    kept = round((1 - _HELD_OUT) * len(record.tension))
    first = Record(record.sample_time, record.tension[:kept], record.output[: kept + 1])
    last = Record(record.sample_time, record.tension[kept:], record.output[kept:])
    return _n4sid(record, min(_ORDERS, key=lambda order: state_space_error(_n4sid(first, order), last)))


def _n4sid(record: Record, order: int) -> StateSpace:
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
    return StateSpace(A, _input_matrix(A, C, record), C, np.zeros((len(C), record.tension.shape[1])))


def _input_matrix(A: np.ndarray, C: np.ndarray, record: Record) -> np.ndarray:
    """B (n, m) with which the model, simulated over the whole record, is the least off; the first state is free too."""
    (samples, m), n = record.tension.shape, len(A)
    # Columns: the states that each entry of B alone would give, column by column of B, and each first state.
    states, rows = np.hstack([np.zeros((n, n * m)), np.eye(n)]), np.zeros((samples, len(C), n * (m + 1)))
    for t, u in enumerate(record.tension):
        states = A @ states
        states[:, : n * m] += np.kron(u, np.eye(n))
        rows[t] = C @ states
    fitted = np.linalg.lstsq(rows.reshape(samples * len(C), -1), record.output[1:].ravel(), rcond=1e-12)[0]
    return fitted[: n * m].reshape(m, n).T
