"""Moves: the inputs that are free, each held over a block of samples."""

from numbers import Integral

import casadi as ca
import numpy as np


def block_lengths(control_horizon: int | tuple[int, ...] | None, horizon: int) -> tuple[int, ...]:
    """Samples over which each move is held; ValueError when they do not make up the horizon."""
    if control_horizon is None:
        return (1,) * horizon
    if isinstance(control_horizon, Integral) and not isinstance(control_horizon, bool):
        moves = int(control_horizon)
        if not 1 <= moves <= horizon:
            raise ValueError(f"control_horizon is a number of moves from 1 to the horizon, {horizon}, not {moves}")
        return (1,) * (moves - 1) + (horizon - moves + 1,)
    lengths = control_horizon
    if not isinstance(lengths, tuple | list | np.ndarray) or not all(
        isinstance(length, Integral) and not isinstance(length, bool) and length >= 1 for length in lengths
    ):
        raise ValueError(
            f"control_horizon is a number of moves, the lengths of blocks in samples or None, not {control_horizon!r}"
        )
    if sum(lengths) != horizon:
        raise ValueError(
            f"the blocks of control_horizon add up to the horizon, {horizon} samples; {tuple(lengths)} add up to "
            f"{sum(lengths)}"
        )
    return tuple(int(length) for length in lengths)


def held(lengths: tuple[int, ...], inputs: int) -> ca.DM:
    """Maps the moves (len(lengths) m) to the inputs of every sample (N m)."""
    return ca.DM(np.kron(np.repeat(np.eye(len(lengths)), lengths, axis=0), np.eye(inputs)))


def previewed(rows: int, horizon: int, outputs: int) -> ca.DM:
    """Maps the rows of the reference that are looked at to those of the whole horizon: the last is held."""
    return ca.DM(np.kron(np.eye(rows)[np.minimum(np.arange(horizon), rows - 1)], np.eye(outputs)))


def changes(samples: int, inputs: int) -> ca.DM:
    """Maps (v_0, v_1, ...) to the changes between them; the first lacks the input before."""
    return ca.DM(np.kron(np.eye(samples) - np.eye(samples, k=-1), np.eye(inputs)))
