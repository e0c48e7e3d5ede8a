from dataclasses import dataclass
from math import inf
from typing import Any, NoReturn

import numpy as np
from numpy.typing import ArrayLike

from .store import ForeignTypeError


@dataclass
class AbsentPlant:
    """Stands for a robot that is known by its run folder alone: what was measured can be read, nothing can be flown."""

    kind: str
    sample_time: float
    inputs: int
    outputs: int

    @property
    def tension(self) -> np.ndarray:
        return np.zeros(self.inputs)

    @property
    def disturbance(self) -> np.ndarray:
        return np.zeros(0)

    def reset(
        self, tip: ArrayLike | None = None, *, seed: int | None = None, tension_bounds: tuple[Any, Any] = (-inf, inf)
    ) -> np.ndarray:
        self._refuse()

    def step(self, tension: ArrayLike, tip_force: ArrayLike | None = None) -> np.ndarray:
        self._refuse()

    def _refuse(self) -> NoReturn:
        raise ForeignTypeError(f"{self.kind} can only be made by the study script that defines it")
