from math import inf
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike


class PlantFailure(RuntimeError):
    """The plant left the range in which an experiment makes sense, and must be reset; ``reason`` says how."""

    def __init__(self, reason: str) -> None:
        super().__init__(reason)
        self.reason = reason


@runtime_checkable
class Plant(Protocol):
    """What a closed-loop experiment needs of a robot, simulated or real.

    A sample goes: ``step(tension)`` holds the tension for one ``sample_time`` and returns what is measured then.
    A plant may have ``prepare()``, called once before the first experiment of a run: what it raises is no result of an
    experiment and ends the run. A plant may know more: ``true_output`` (outputs,), without which experiments report
    errors by what was measured; ``shape(n)`` (n, 3) m, without which they hold no shapes; ``disturbance`` (d,), what is
    measured now of the disturbances that an MPC is to be told; and ``output_unit`` and ``input_unit``, texts, without
    which headings say m and N.
    """

    @property
    def sample_time(self) -> float:
        """Time between two measurements, s."""
        ...

    @property
    def inputs(self) -> int:
        """Number of tensions."""
        ...

    @property
    def outputs(self) -> int:
        """Number of measured values."""
        ...

    @property
    def tension(self) -> np.ndarray:
        """The tensions held now (inputs,), N; after a reset those that hold the pose."""
        ...

    def reset(
        self, tip: ArrayLike | None = None, *, seed: int | None = None, tension_bounds: tuple[Any, Any] = (-inf, inf)
    ) -> np.ndarray:
        """Bring the plant to rest, with the tip at (y, z) = ``tip`` if given, and return the measurement (outputs,)."""
        ...

    def step(self, tension: ArrayLike, tip_force: ArrayLike | None = None) -> np.ndarray:
        """Hold ``tension`` (inputs,) N for one sample and return the measurement (outputs,) at its end."""
        ...
