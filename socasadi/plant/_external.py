from dataclasses import dataclass
from math import inf, isfinite
from numbers import Integral
from typing import Any, NoReturn

import numpy as np
from numpy.typing import ArrayLike


class ExternalPlantError(RuntimeError):
    """A robot that this program cannot move was to be flown."""


@dataclass
class ExternalPlant:
    """A robot that Python never touches: its experiments are flown elsewhere, by hand or by another program.

    It says what a study has to know of the robot and can do nothing: a campaign on it asks and is told
    (``socasadi init``, ``ask`` and ``tell``).

    Parameters
    ----------
    sample_time
        Time between two measurements, s.
    inputs, outputs
        Number of its inputs and of its measured values.
    name
        What messages call it.
    output_unit, input_unit
        Units of its outputs and inputs, for headings.

    Raises
    ------
    ValueError
        A number is out of its range.

    Examples
    --------
    >>> ExternalPlant(sample_time=0.02, inputs=3, outputs=2, name="the arm in room 12").step([1.0, 0.0, 0.0])
    Traceback (most recent call last):
        ...
    socasadi.plant.ExternalPlantError: the arm in room 12 cannot be flown from here: ...
    """

    sample_time: float
    inputs: int
    outputs: int
    name: str = "the robot"
    output_unit: str = "m"
    input_unit: str = "N"

    def __post_init__(self) -> None:
        time = self.sample_time
        if not (isinstance(time, int | float) and isfinite(time) and time > 0):
            raise ValueError(f"ExternalPlant: sample_time is {time!r} s, but must be above zero")
        for count in ("inputs", "outputs"):
            if not isinstance(value := getattr(self, count), Integral) or value < 1:
                raise ValueError(f"ExternalPlant: {count} is {value!r}, but must be a positive integer")
        for text in ("name", "output_unit", "input_unit"):
            if not isinstance(value := getattr(self, text), str) or not value:
                raise ValueError(f"ExternalPlant: {text} is {value!r}, but must be a text")

    @property
    def tension(self) -> np.ndarray:
        """Zeros (inputs,): what it holds is not known here."""
        return np.zeros(self.inputs)

    @property
    def disturbance(self) -> np.ndarray:
        """Nothing (0,): what it measures of disturbances comes with its recordings."""
        return np.zeros(0)

    def prepare(self) -> None:
        """Refuse a run, before it makes a trial."""
        self._refuse()

    def reset(
        self, tip: ArrayLike | None = None, *, seed: int | None = None, tension_bounds: tuple[Any, Any] = (-inf, inf)
    ) -> np.ndarray:
        """Refuse."""
        self._refuse()

    def step(self, tension: ArrayLike, tip_force: ArrayLike | None = None) -> np.ndarray:
        """Refuse."""
        self._refuse()

    def _refuse(self) -> NoReturn:
        raise ExternalPlantError(
            f"{self.name} cannot be flown from here: bring its experiments by `socasadi init`, `ask` and `tell`, "
            "or run the study script that can move it"
        )
