"""What a controller is worth: flown again under noise that it has not seen, here and on other robots."""

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import ArrayLike

from ...campaign import Pilot, Stream, Study, drawn_seed, fly_once, probe
from ...model import state_space_error
from ...mpc import Controller, ControllerInfo, LinearMPC
from ...plant import Plant
from ..lab import Bounded, believed

Elsewhere = Mapping[str, Callable[[Plant], Plant]]
"""Other robots by name: each made of a study's own."""


@dataclass(frozen=True)
class Worth:
    """A controller flown several times; medians over the flights that did not fail.

    Attributes
    ----------
    J, rmse
        Of each flight; infinite where it failed. rmse in m.
    settled
        Root mean square distance of the true outputs from the reference over the last quarter, m.
    violated
        Share of samples whose true outputs are beyond the output bounds.
    effort
        Root mean square of the inputs as shares of u_max.
    solve
        Wall time of a step of the controller, from Python: median, 99 % quantile and longest, s.
    fallbacks
        Samples without an answer of the controller's own, over all flights.
    failure
        Why the first of those that failed did; None if none did.
    """

    J: tuple[float, ...]
    rmse: tuple[float, ...]
    settled: float
    violated: float
    effort: float
    solve: tuple[float, float, float]
    fallbacks: int
    failure: str | None = None

    @property
    def failed(self) -> int:
        """Flights that failed."""
        return sum(np.isinf(self.J))


def worth(study: Study, pilot: Pilot, flights: int) -> tuple[Worth, np.ndarray]:
    """What ``pilot`` is worth in so many flights, and the true outputs (T + 1, p) of the first."""
    timed = _Timed(pilot)
    J, rmse, told, fallbacks, path = [], [], [], 0, np.zeros((0, study.mpc.outputs))
    failure = None
    for i in range(1, flights + 1):
        episode = fly_once(study, Bounded(timed, study.mpc), (Stream.VERIFICATION, i))
        fallbacks += episode.fallbacks
        if i == 1:
            path = episode.truth
        failure = failure or episode.failure
        whole = episode.failure is None and np.isfinite(episode.output).all()
        score = study.cost.score(episode, study.mpc.input_scale) if whole else None
        J.append(score.J if score else np.inf)
        rmse.append(score.rmse if score else np.inf)
        if score:
            distance = np.linalg.norm(episode.truth - episode.reference, axis=1)[-len(episode.tension) // 4 :]
            limits, beyond = study.mpc.output_limits, 0.0
            if limits is not None:
                beyond = float(np.mean(((episode.truth < limits[0]) | (episode.truth > limits[1])).any(axis=1)))
            used = np.sqrt(np.mean((episode.tension / study.mpc.input_scale) ** 2))
            told.append((np.sqrt(np.mean(distance**2)), beyond, used))
    settled, violated, effort = np.median(told, axis=0).tolist() if told else (np.inf, np.nan, np.nan)
    steps = np.array(timed.seconds or [np.nan])
    solve = (float(np.median(steps)), float(np.quantile(steps, 0.99)), float(steps.max()))
    return Worth(tuple(J), tuple(rmse), settled, violated, effort, solve, fallbacks, failure), path


def open_loop_error(study: Study, pilot: Pilot) -> float:
    """How far the prediction model in a controller is off on a probing record that no method has seen, m.

    Root mean square distance over the record, without any correction; NaN of a controller without a model, and where
    the robot does not bear to be probed. A pilot that is no :class:`Controller` says it itself, by a method
    ``prediction_error(record)``.
    """
    if isinstance(pilot, Controller):
        if pilot.mpc.delay or pilot.mpc.measured_disturbances:
            return np.nan
        error = partial(state_space_error, believed(pilot))
    elif (error := getattr(pilot, "prediction_error", None)) is None:
        return np.nan
    seed = drawn_seed(study.seed, Stream.VERIFICATION, 0)
    try:
        record = probe(study.plant, study.mpc.input_bounds, seed=seed)
    except Exception:  # whatever a plant raises
        return np.nan
    return error(record)


def worth_elsewhere(study: Study, pilot: Pilot, flights: int, others: Elsewhere) -> dict[str, Worth]:
    """What a controller that was made for the study's robot is worth on others."""
    return {name: worth(replace(study, plant=other(study.plant)), pilot, flights)[0] for name, other in others.items()}


class _Timed:
    """A pilot, its steps timed."""

    def __init__(self, pilot: Pilot) -> None:
        self.mpc: LinearMPC = pilot.mpc
        self.seconds: list[float] = []
        self._pilot = pilot

    @property
    def info(self) -> ControllerInfo:
        return self._pilot.info

    def reset(self, u_prev: ArrayLike = 0.0) -> None:
        self._pilot.reset(u_prev)

    def step(self, y: ArrayLike, reference: ArrayLike, disturbance: ArrayLike | None = None) -> np.ndarray:
        start = time.perf_counter()
        u = self._pilot.step(y, reference, disturbance)
        self.seconds.append(time.perf_counter() - start)
        return u
