import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import ArrayLike

from ...model import Record
from ...mpc import ControllerInfo, LinearMPC
from ...plant import Plant
from ._interrupt import check_interrupt
from ._task import Task

if TYPE_CHECKING:
    from ._cost import Cost, Meter

_SHAPE_POINTS = 15
_SHAPE_EVERY = 5


class Pilot(Protocol):
    """What an episode needs of a controller, wherever it runs; see :class:`socasadi.mpc.Controller`."""

    mpc: LinearMPC

    @property
    def info(self) -> ControllerInfo: ...

    def reset(self, u_prev: ArrayLike = 0.0) -> None: ...

    def step(self, y: ArrayLike, reference: ArrayLike, disturbance: ArrayLike | None = None) -> np.ndarray: ...


@dataclass(frozen=True, eq=False)
class Episode:
    """What one flight of a controller gave, up to its end or its failure.

    Attributes
    ----------
    sample_time
        s.
    output, reference, truth
        (T + 1, p) m, measured, wanted and true outputs at t = 0, 1, ... T samples. A plant that does not know its
        true outputs has the measured ones in their place.
    tension
        (T, m) N; row t was held from sample t to t + 1.
    held
        (m,) N, the tensions before the first sample.
    shapes
        (k, points, 3) m, the rod every fifth sample; empty when the plant does not know its shape.
    disturbance
        (T, d) measured disturbances that the controller was told; (T, 0) when it takes none.
    fallbacks
        Samples in which the controller could not apply its QP's answer.
    failure
        Why the episode ended early, None when it did not.
    cut
        Of an episode that was ended because it was hopeless, what its samples prove that J would have been at least;
        None of any other.
    seconds
        Wall time spent in the ``"plant"`` and in the ``"controller"``.
    """

    sample_time: float
    output: np.ndarray
    reference: np.ndarray
    truth: np.ndarray
    tension: np.ndarray
    held: np.ndarray
    shapes: np.ndarray
    disturbance: np.ndarray = field(default_factory=lambda: np.zeros((0, 0)))
    fallbacks: int = 0
    failure: str | None = None
    cut: float | None = None
    seconds: dict[str, float] = field(default_factory=dict)

    @property
    def time(self) -> np.ndarray:
        """Instants of the outputs (T + 1,), s."""
        return self.sample_time * np.arange(len(self.output))

    @property
    def shape_time(self) -> np.ndarray:
        """Instants of the shapes (k,), s."""
        return self.sample_time * _SHAPE_EVERY * np.arange(len(self.shapes))

    @property
    def record(self) -> Record:
        """Tensions and measured outputs, for identification."""
        return Record(self.sample_time, self.tension, self.output)


def fly(
    plant: Plant,
    controller: Pilot,
    task: Task,
    *,
    seed: int,
    time_limit: float,
    give_up: float | None = None,
    cost: "Cost | None" = None,
) -> Episode:
    """Run ``controller`` against ``plant`` along the task's reference.

    What the plant raises ends the episode and is its ``failure``, as is more than ``time_limit`` s of wall time; the
    samples until then are kept.

    Parameters
    ----------
    seed
        Of the plant's noise.
    time_limit
        s.
    give_up
        Value of J from which on the episode is of no interest: once its samples prove that J will be more, it is
        ``cut``. None: it is flown to its end.
    cost
        The J that is meant.

    Raises
    ------
    ValueError
        ``give_up`` without ``cost``.
    """
    if give_up is not None and cost is None:
        raise ValueError(f"give_up={give_up} is a value of J: give the cost that it is of")
    mpc = controller.mpc
    samples, preview = task.samples(mpc.sample_time), np.arange(1, mpc.reference_rows + 1)
    flight = _Flight(plant, mpc.sample_time, task)
    deadline = time.monotonic() + time_limit
    try:
        with flight.timing("plant"):
            y = measured(plant, plant.reset(task.start, seed=seed, tension_bounds=mpc.input_bounds))
        flight.begin(y)
        if give_up is not None and cost is not None:
            flight.meter = cost.meter(flight.held, plant.outputs, mpc.input_scale)
        controller.reset(plant.tension)
        for t in range(samples):
            check_interrupt()
            if time.monotonic() > deadline:
                raise TimeoutError(f"took longer than its limit of {time_limit:g} s")
            wanted = task.reference((t + preview) * mpc.sample_time)
            known = np.array(getattr(plant, "disturbance", ()), dtype=float) if mpc.measured_disturbances else None
            with flight.timing("controller"):
                u = controller.step(y, wanted, known)
            force = {} if task.pulse is None else {"tip_force": task.pulse.at(t * mpc.sample_time)}
            with flight.timing("plant"):
                y = measured(plant, plant.step(u, **force))
            spent = flight.note(u, y, known)
            # What is not finite is for the next step to refuse, and nothing is saved by cutting a finished episode.
            if give_up is not None and give_up < spent < np.inf and t + 1 < samples:
                return flight.end(controller.info.fallbacks, cut=spent)
    except Exception as error:  # whatever a plant raises is a result of the experiment
        check_interrupt()
        return flight.end(controller.info.fallbacks, failure=f"{type(error).__name__}: {error}")
    return flight.end(controller.info.fallbacks)


def measured(plant: Plant, y: ArrayLike) -> np.ndarray:
    """What a plant returned, as an array of one's own, since plants may use theirs again; ValueError if no output."""
    try:
        values = np.array(y, dtype=float)
    except (TypeError, ValueError):
        raise ValueError(f"the plant returned {y!r} for its outputs; ({plant.outputs},) numbers are needed") from None
    if values.shape != (plant.outputs,):
        raise ValueError(f"the plant returned outputs of shape {values.shape}; ({plant.outputs},) is needed")
    return values


class _Flight:
    """Collects an episode while it happens."""

    def __init__(self, plant: Plant, sample_time: float, task: Task) -> None:
        self.plant, self.sample_time = plant, sample_time
        self.reference = task.reference(sample_time * np.arange(task.samples(sample_time) + 1))
        self.output: list[np.ndarray] = []
        self.truth: list[np.ndarray] = []
        self.tension: list[np.ndarray] = []
        self.shapes: list[np.ndarray] = []
        self.disturbance: list[np.ndarray] = []
        self.held = np.zeros(plant.inputs)
        self.meter: Meter | None = None
        self.seconds = {"plant": 0.0, "controller": 0.0}

    @contextmanager
    def timing(self, part: str) -> Iterator[None]:
        start = time.perf_counter()
        try:
            yield
        finally:
            self.seconds[part] += time.perf_counter() - start

    def begin(self, y: np.ndarray) -> None:
        self.held = np.array(self.plant.tension, dtype=float)
        self._see(y)

    def note(self, u: np.ndarray, y: np.ndarray, disturbance: np.ndarray | None) -> float:
        """Keep a sample; the cost so far, 0 where nobody asked."""
        self.tension.append(u)
        self.disturbance.append(np.zeros(0) if disturbance is None else disturbance)
        self._see(y)
        if self.meter is None:
            return 0.0
        return self.meter.add(y, self.reference[len(self.tension)], u)

    def _see(self, y: np.ndarray) -> None:
        if len(self.output) % _SHAPE_EVERY == 0 and (shape := getattr(self.plant, "shape", None)):
            self.shapes.append(shape(_SHAPE_POINTS))
        self.truth.append(np.array(getattr(self.plant, "true_output", y), dtype=float))
        self.output.append(y)

    def end(self, fallbacks: int, failure: str | None = None, cut: float | None = None) -> Episode:
        p, m = self.plant.outputs, self.plant.inputs
        return Episode(
            sample_time=self.sample_time,
            output=np.reshape(self.output, (-1, p)),
            reference=self.reference[: len(self.output)],
            truth=np.reshape(self.truth, (-1, p)),
            tension=np.reshape(self.tension, (-1, m)),
            held=self.held,
            shapes=np.reshape(self.shapes, (-1, _SHAPE_POINTS, 3)).astype(np.float32),
            disturbance=np.reshape(self.disturbance, (len(self.tension), -1)) if self.tension else np.zeros((0, 0)),
            fallbacks=fallbacks,
            failure=failure,
            cut=cut,
            seconds=self.seconds,
        )
