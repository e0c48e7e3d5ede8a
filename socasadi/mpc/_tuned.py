"""Settings of an MPC that theta holds beside its prediction model: each a factor on what the specification says."""

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ..model import Entry
from .formulation import hashable

if TYPE_CHECKING:
    from ._spec import LinearMPC

_DEVIATIONS = ("measurement_noise", "input_noise", "disturbance_noise")
TUNABLE = ("Q", "R", "rate_weight", "slack_weight", *_DEVIATIONS)
"""What theta may hold a factor on."""

_RANGE = (0.01, 100.0)
"""Factors that are searched where no range is given."""


def tuned_entries(tuned: Any) -> tuple[tuple[str, float, float], ...]:
    """``tuned`` of an MPC in one form: name, least and largest factor.

    Raises
    ------
    ValueError
        A name is unknown or stands twice, or a range is not one of positive factors.
    """
    if isinstance(tuned, str):
        raise ValueError(f"tuned is a tuple of names of settings, not the text {tuned!r}")
    listed = [(name, *bounds) for name, bounds in tuned.items()] if isinstance(tuned, Mapping) else list(tuned)
    entries: list[tuple[str, float, float]] = []
    for item in listed:
        name, *bounds = [item] if isinstance(item, str) else item
        if name not in TUNABLE:
            raise ValueError(f"tuned names {name!r}; what can be tuned is {', '.join(TUNABLE)}")
        if any(name == known for known, *_ in entries):
            raise ValueError(f"tuned names {name!r} twice")
        lower, upper = map(float, bounds or _RANGE)
        if not 0 < lower < upper < np.inf:
            raise ValueError(f"tuned gives {name!r} the factors {lower:g} to {upper:g}; two that ascend are needed")
        entries.append((name, lower, upper))
    return tuple(entries)


def factors(mpc: "LinearMPC") -> tuple[Entry, ...]:
    """The entries of theta behind those of the prediction model."""
    return tuple(Entry(f"{name}_factor", "1", lower, upper, "log") for name, lower, upper in mpc.tuned)


def settled(mpc: "LinearMPC", values: np.ndarray) -> "LinearMPC":
    """The MPC with its settings multiplied by the factors in ``values`` (tuned,), and nothing of them left open."""
    if not mpc.tuned:
        return mpc
    changed = {
        name: _scaled(name, getattr(mpc, name), float(value))
        for (name, *_), value in zip(mpc.tuned, values, strict=True)
    }
    return replace(mpc, **changed, tuned=())


def _scaled(name: str, setting: Any, factor: float) -> Any:
    value = np.asarray(setting, dtype=float)
    # A matrix of noise is a covariance, of which a deviation is the root.
    return hashable(value * (factor**2 if name in _DEVIATIONS and value.ndim == 2 else factor))
