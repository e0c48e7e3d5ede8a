"""The constraints as rows over the moves: the box, then rates, then soft outputs."""

from typing import TYPE_CHECKING, NamedTuple

import casadi as ca
import numpy as np

from ._condense import Prediction
from ._moves import changes
from ._parameters import Parameters

if TYPE_CHECKING:
    from .._spec import LinearMPC


class Rows(NamedTuple):
    """lower <= rows z + free p <= upper; soft rows may exceed their bounds, at price s + quadratic s^2 / 2."""

    rows: ca.MX | ca.DM
    free: ca.MX
    lower: np.ndarray
    upper: np.ndarray
    quadratic: np.ndarray
    """Infinite: the row is hard."""
    price: np.ndarray


def constraint_rows(mpc: "LinearMPC", parameters: Parameters, prediction: Prediction, hold: ca.DM) -> list[Rows]:
    """All of them, in the order in which they stand in the QP. The first m rows are the first input itself."""
    found = [_box(mpc, parameters)]
    if mpc.rate_limits is not None:
        found.append(_rates(mpc, parameters, *mpc.rate_limits))
    if mpc.output_limits is not None:
        found.append(_outputs(mpc, parameters, prediction, hold, *mpc.output_limits))
    return found


def _box(mpc: "LinearMPC", parameters: Parameters) -> Rows:
    moves = len(mpc.blocks)
    lower, upper = (np.tile(limit / mpc.input_scale, moves) for limit in mpc.input_limits)
    return _hard(ca.DM.eye(len(lower)), parameters.map(len(lower)), lower, upper)


def _rates(mpc: "LinearMPC", parameters: Parameters, lower: np.ndarray, upper: np.ndarray) -> Rows:
    """Between one block and the next; within a block nothing changes."""
    moves, m = len(mpc.blocks), mpc.inputs
    slowest, fastest = (np.tile(limit * mpc.sample_time / mpc.input_scale, moves) for limit in (lower, upper))
    first = ca.vertcat(ca.MX.eye(m), ca.MX((moves - 1) * m, m))
    bounded = np.flatnonzero(np.isfinite(slowest) | np.isfinite(fastest)).tolist()
    free = parameters.map(moves * m, v=-first)
    return _hard(changes(moves, m)[bounded, :], free[bounded, :], slowest[bounded], fastest[bounded])


def _outputs(
    mpc: "LinearMPC", parameters: Parameters, prediction: Prediction, hold: ca.DM, lower: np.ndarray, upper: np.ndarray
) -> Rows:
    """As shares of the largest bound, so that rows are of the size of the others whatever the output's unit."""
    largest, N, p = mpc.largest_output_bound, mpc.horizon, mpc.outputs
    free = parameters.map(N * p, **parameters.known(prediction.output_free)) / largest
    forced = prediction.output_forced @ hold / largest
    # What comes within the delay is decided already.
    kept = [k * p + i for k in range(mpc.delay, N) for i in range(p) if np.isfinite([lower[i], upper[i]]).any()]
    below, above, quadratic, price = (
        np.tile(np.broadcast_to(values, p), N)[kept]
        for values in (
            lower / largest,
            upper / largest,
            2 * np.asarray(mpc.slack_weight) * largest**2,
            np.asarray(mpc.slack_linear) * largest,
        )
    )
    return Rows(forced[kept, :], free[kept, :], below, above, quadratic, price)


def _hard(rows: ca.DM, free: ca.MX, lower: np.ndarray, upper: np.ndarray) -> Rows:
    return Rows(rows, free, lower, upper, np.full(len(lower), np.inf), np.zeros(len(lower)))
