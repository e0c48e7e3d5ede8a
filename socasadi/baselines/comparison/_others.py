"""Robots that are not the one a controller was made for: each changes one thing of a simulated rod."""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace
from math import inf
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ...plant import Plant, SimulatedPlant
from ...rod import Cable, Division, Payload, Rod


@dataclass(frozen=True)
class Softer:
    """The same rod of other materials: factors on the stiffness and the damping of all divisions."""

    young: float = 1.0
    damping: float = 1.0

    def __call__(self, plant: Plant) -> SimulatedPlant:
        return _another_rod(plant, lambda rod: replace(rod, divisions=tuple(map(self._softened, rod.divisions))))

    def _softened(self, division: Division) -> Division:
        material = division.material
        return replace(
            division,
            material=replace(material, young=self.young * material.young, damping=self.damping * material.damping),
            stiffness=_scaled(division.stiffness, self.young),
            damping=_scaled(division.damping, self.damping),
        )


@dataclass(frozen=True)
class Loaded:
    """The same rod with a mass at its tip, kg."""

    mass: float

    def __call__(self, plant: Plant) -> SimulatedPlant:
        return _another_rod(plant, lambda rod: replace(rod, payloads=(*rod.payloads, Payload(self.mass))))


@dataclass(frozen=True)
class Misrouted:
    """The same rod with one cable so many times as far from the axis."""

    factor: float
    cable: int = 0

    def __call__(self, plant: Plant) -> SimulatedPlant:
        def moved(cable: Cable) -> Cable:
            if not isinstance(cable.route, tuple):
                raise TypeError("only a cable parallel to the axis can be misrouted by a factor")
            return replace(cable, route=tuple(self.factor * offset for offset in cable.route))

        return _another_rod(plant, lambda rod: replace(rod, cables=_with(rod.cables, self.cable, moved)))


@dataclass(frozen=True)
class Rubbing:
    """The same rod with a coefficient of friction along all cables."""

    friction: float

    def __call__(self, plant: Plant) -> SimulatedPlant:
        return _another_rod(
            plant, lambda rod: replace(rod, cables=tuple(replace(c, friction=self.friction) for c in rod.cables))
        )


@dataclass(frozen=True)
class Noisier:
    """The same robot seen by a sensor with so many times the noise."""

    factor: float

    def __call__(self, plant: Plant) -> SimulatedPlant:
        return _another_rod(plant, noise=self.factor)


@dataclass(frozen=True)
class DeadCable:
    """The same robot, one of whose cables does nothing."""

    cable: int = 0

    def __call__(self, plant: Plant) -> Plant:
        _check_cable(self.cable, plant.inputs)
        return _Between(plant, cut=self.cable)


@dataclass(frozen=True)
class Delayed:
    """The same robot, whose inputs act so many samples late."""

    samples: int = 1

    def __call__(self, plant: Plant) -> Plant:
        if self.samples < 0:
            raise ValueError(f"inputs act 0 samples late or more, not {self.samples}")
        return _Between(plant, late=self.samples)


class _Between:
    """A plant whose inputs are changed on their way to it."""

    def __init__(self, plant: Plant, cut: int | None = None, late: int = 0) -> None:
        self.plant, self.cut, self.late = plant, cut, late
        self._way: deque[np.ndarray] = deque()

    @property
    def sample_time(self) -> float:
        return self.plant.sample_time

    @property
    def inputs(self) -> int:
        return self.plant.inputs

    @property
    def outputs(self) -> int:
        return self.plant.outputs

    @property
    def tension(self) -> np.ndarray:
        return self.plant.tension

    @property
    def true_output(self) -> np.ndarray:
        return np.array(getattr(self.plant, "true_output"))  # noqa: B009 (a plant may lack it)

    def reset(
        self, tip: ArrayLike | None = None, *, seed: int | None = None, tension_bounds: tuple[Any, Any] = (-inf, inf)
    ) -> np.ndarray:
        y = self.plant.reset(tip, seed=seed, tension_bounds=tension_bounds)
        self._way = deque([self.plant.tension] * self.late)
        return y

    def step(self, tension: ArrayLike, tip_force: ArrayLike | None = None) -> np.ndarray:
        self._way.append(np.array(tension, dtype=float))
        given = self._way.popleft()
        if self.cut is not None:
            given[self.cut] = 0.0
        return self.plant.step(given) if tip_force is None else self.plant.step(given, tip_force=tip_force)


def _check_cable(index: int, cables: int) -> None:
    if not 0 <= index < cables:
        raise ValueError(f"there is no cable {index}; the robot's are 0 to {cables - 1}")


def _another_rod(plant: Plant, change: Callable[[Rod], Rod] = lambda rod: rod, noise: float = 1.0) -> SimulatedPlant:
    if not isinstance(plant, SimulatedPlant):
        raise TypeError(f"only a simulated rod can be changed, not {type(plant).__name__}")
    return SimulatedPlant(change(plant.rod), plant.sample_time, noise * plant.noise, plant.output, plant.substep)


def _scaled(law: Any, factor: float) -> Any:
    """Of a division, so many times as large: None, numbers, or a function of the place."""
    if law is None:
        return None
    return (lambda x: factor * np.asarray(law(x))) if callable(law) else factor * np.asarray(law)


def _with(cables: tuple[Any, ...], index: int, change: Callable[[Any], Any]) -> tuple[Any, ...]:
    _check_cable(index, len(cables))
    return tuple(change(cable) if i == index else cable for i, cable in enumerate(cables))
