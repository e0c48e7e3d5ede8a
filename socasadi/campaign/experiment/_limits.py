"""Limits beside J that an experiment is measured against."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import isfinite
from numbers import Real
from typing import Protocol, runtime_checkable

import numpy as np

from ...mpc import LinearMPC
from ._episode import Episode


@runtime_checkable
class Limit(Protocol):
    """A number that an experiment gives beside J, and that is to stay at or below a limit: a frozen dataclass.

    One that asks something of the MPC may have ``check(mpc)``, which raises ValueError.
    """

    @property
    def name(self) -> str:
        """What it is called, unique in a study."""
        ...

    @property
    def unit(self) -> str:
        """Its unit; empty for a pure number."""
        ...

    @property
    def limit(self) -> float:
        """The largest value that is accepted."""
        ...

    def measure(self, episode: Episode, mpc: LinearMPC) -> float:
        """Its value in an episode that was flown to its end; a finite number."""
        ...


@dataclass(frozen=True)
class Overshoot:
    """How far the outputs go past their reference, m: along the line from where they start to where they are wanted.

    With :math:`e_t = y_t - r_t` (true outputs where they are known) and the direction :math:`d = -e_0 / |e_0|` it is
    the largest :math:`e_t \\cdot d`, and never less than 0. A task that starts where it wants the outputs has none.

    Parameters
    ----------
    limit
        m.
    """

    limit: float

    def __post_init__(self) -> None:
        _not_negative("limit of Overshoot", self.limit, "m")

    @property
    def name(self) -> str:
        return "overshoot"

    @property
    def unit(self) -> str:
        return "m"

    def measure(self, episode: Episode, mpc: LinearMPC) -> float:
        error = episode.truth - episode.reference
        distance = np.linalg.norm(error[0])
        return float(np.max(-error @ error[0] / distance, initial=0.0)) if distance else 0.0


@dataclass(frozen=True)
class ViolatedOutputs:
    """Share of the samples in which an output (true where it is known) is outside the MPC's output bounds.

    Parameters
    ----------
    limit
        0 to 1.
    """

    limit: float

    def __post_init__(self) -> None:
        _not_negative("limit of ViolatedOutputs", self.limit, "of the samples")

    @property
    def name(self) -> str:
        return "violated_outputs"

    @property
    def unit(self) -> str:
        return ""

    def check(self, mpc: LinearMPC) -> None:
        """ValueError when the MPC has no output bounds."""
        if mpc.output_limits is None:
            raise ValueError("ViolatedOutputs counts what is outside output_bounds, but this MPC has none")

    def measure(self, episode: Episode, mpc: LinearMPC) -> float:
        self.check(mpc)
        assert mpc.output_limits is not None
        lower, upper = mpc.output_limits
        outside = (episode.truth[1:] < lower) | (episode.truth[1:] > upper)
        return float(np.mean(outside.any(axis=1)))


@dataclass(frozen=True)
class SettlingTime:
    """Time from which on the outputs (true where they are known) stay within ``band`` of their reference, s.

    Where they never do, it is one sample more than the episode lasts.

    Parameters
    ----------
    limit
        s.
    band
        Largest distance from the reference that counts as settled, m.
    """

    limit: float
    band: float

    def __post_init__(self) -> None:
        _not_negative("limit of SettlingTime", self.limit, "s")
        _not_negative("band of SettlingTime", self.band, "m")

    @property
    def name(self) -> str:
        return "settling_time"

    @property
    def unit(self) -> str:
        return "s"

    def measure(self, episode: Episode, mpc: LinearMPC) -> float:
        outside = np.linalg.norm(episode.truth - episode.reference, axis=1) > self.band
        last = int(np.flatnonzero(outside)[-1]) if outside.any() else -1
        return episode.sample_time * (last + 1)


@dataclass(frozen=True)
class MeasuredLimit:
    """A limit of one's own.

    Parameters
    ----------
    name, unit
        What is measured, and in what.
    limit
        The largest value that is accepted.
    function
        (episode, mpc) -> value. The run's folder alone cannot make it: ``ask`` and ``tell`` then want the script.
    """

    name: str
    unit: str
    limit: float
    function: Callable[[Episode, LinearMPC], float]

    def __post_init__(self) -> None:
        if not callable(self.function):
            raise TypeError(f"function of MeasuredLimit is called with (episode, mpc), and {self.function!r} cannot be")

    def measure(self, episode: Episode, mpc: LinearMPC) -> float:
        return self.function(episode, mpc)


def check_limits(limits: Sequence[Limit], mpc: LinearMPC) -> None:
    """TypeError or ValueError when these are no limits of a study with that MPC."""
    if not isinstance(limits, tuple | list):
        raise TypeError(f"limits of a study are a tuple, such as (Overshoot(0.005),), not {limits!r}")
    names = []
    for limit in limits:
        if isinstance(limit, type) or not isinstance(limit, Limit):
            raise TypeError(f"a limit has name, unit, limit and measure, such as Overshoot(0.005); {limit!r} has not")
        if not (isinstance(limit.name, str) and limit.name):
            raise ValueError(f"the name of a limit is a text, not {limit.name!r}")
        if not _finite(limit.limit):
            raise ValueError(f"the limit on {limit.name} must be finite, not {limit.limit!r} {limit.unit}".rstrip())
        if limit.name in names:
            raise ValueError(f"two limits of the study are called {limit.name!r}; names tell them apart")
        names.append(limit.name)
        if check := getattr(limit, "check", None):
            check(mpc)


def measure_limits(limits: Sequence[Limit], episode: Episode, mpc: LinearMPC) -> dict[str, float]:
    """Each limit's value in an episode, by name; ValueError where it is no finite number."""
    values = {limit.name: limit.measure(episode, mpc) for limit in limits}
    for limit in limits:
        if not _finite(value := values[limit.name]):
            raise ValueError(f"{limit.name} was measured to be {value!r} {limit.unit}".rstrip() + ", no finite number")
    return {name: float(value) for name, value in values.items()}


def _finite(value: object) -> bool:
    return isinstance(value, Real) and isfinite(value)


def _not_negative(what: str, value: float, unit: str) -> None:
    if not (_finite(value) and value >= 0):
        raise ValueError(f"{what} must be finite and not negative, not {value!r} {unit}")
