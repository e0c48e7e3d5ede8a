from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ...campaign import Episode, Pilot, Stream, Study, Task, drawn_seed, fly_once, probe
from ...model import Record
from ...plant import Plant
from ._bounded import Bounded

_ROUNDING = 1e-9


class BudgetSpent(Exception):
    """The next experiment would take more of the robot's time than there is."""


class Lab:
    """A robot with a task, lent for so many seconds of its time: what all methods are given alike.

    Experiments are those of a campaign of the same study: the same cost, the same bounds, the same noise in the
    experiment of the same number. The study's initial thetas are not used.

    Parameters
    ----------
    study
        Robot, task, cost, and the MPC's bounds and sample time.
    checkpoints
        s of the robot's time at which a method is asked for its controller, ascending; the last is all there is.
    known
        The plant whose model is at hand, for methods that take one: the study's, or one that is not quite like it.

    Attributes
    ----------
    spent
        s of the robot's time so far.
    flights, probes, failed
        Experiments so far: of controllers, without one, and those of the former that failed.
    numbered
        The highest number of a flight so far; its noise depends on it.
    failure
        Why the first flight that failed did; None if none did.

    Raises
    ------
    ValueError
        There is no checkpoint, or they do not ascend from more than 0 s; or the study has limits or conditions, which
        not all methods could keep.
    """

    def __init__(self, study: Study, checkpoints: Sequence[float], known: Plant | None = None) -> None:
        self.study, self.checkpoints, self.known = study, tuple(checkpoints), study.plant if known is None else known
        if not self.checkpoints or list(self.checkpoints) != sorted({*self.checkpoints}) or self.checkpoints[0] <= 0:
            raise ValueError(f"checkpoints are seconds that ascend from more than 0, not {list(checkpoints)}")
        check_lent(study)
        self.spent = 0.0
        self.flights = self.probes = self.failed = self.numbered = 0
        self.failure: str | None = None

    @property
    def failures(self) -> str | None:
        """How many flights failed, and why the first; None if none did."""
        if self.failure is None:
            return None
        return f"{self.failed} of {self.flights} flights failed, the first by {self.failure}"

    def due(self, flights: int = 1) -> bool:
        """Whether so many more flights may pass a checkpoint: who has a controller to offer should do so now."""
        then = self.spent + flights * self.study.task.duration
        return any(self.spent <= at + _ROUNDING < then for at in self.checkpoints)

    def probe(self, duration: float = 20.0, hold: float = 1.0, *, least: int = 1) -> Record:
        """A probing record of so many s: random steps of all tensions, half of the way to their bounds at most.

        Each is held for ``hold`` s: the shorter, the less is told of the gain at rest, on which all tracking stands.

        Raises
        ------
        ValueError
            It would have fewer than ``least`` samples, without which it is of no use.
        BudgetSpent
            There is not so much time left.
        """
        if (samples := round(duration / self.study.plant.sample_time)) < least:
            raise ValueError(f"a record of {duration:g} s has {samples} samples; {least} are needed: probe for longer")
        self._check(duration)
        self.probes += 1
        seed = drawn_seed(self.study.seed, Stream.PROBE, self.probes)
        record = probe(self.study.plant, self.study.mpc.input_bounds, duration=duration, hold=hold, seed=seed)
        self.spent += duration
        return record

    def fly(
        self,
        pilot: Pilot,
        *,
        give_up: float | None = None,
        number: int | None = None,
        plant: Plant | None = None,
        task: Task | None = None,
    ) -> Episode:
        """One experiment with a controller, which fails where an input leaves the bounds of the study's MPC.

        Parameters
        ----------
        give_up
            Value of J from which on it is cut; the seconds that it saves are not counted.
        number
            Of the experiment, which decides on its noise; by default the one after the highest so far.
        plant, task
            Others than the study's, which take the robot's time alike.

        Raises
        ------
        BudgetSpent
            There is not time for a whole one.
        """
        changed = {name: part for name, part in (("plant", plant), ("task", task)) if part is not None}
        study = replace(self.study, **changed)
        self._check(study.task.duration)
        self.flights += 1
        number = self.numbered + 1 if number is None else number
        self.numbered = max(self.numbered, number)
        episode = fly_once(study, Bounded(pilot, study.mpc), (Stream.TRIAL, number), give_up)
        # Where not even the first sample came, the robot was occupied all the same.
        self.spent += max(len(episode.tension), 1) * episode.sample_time
        self.failed += episode.failure is not None
        self.failure = self.failure or episode.failure
        return episode

    def records(self, pilot: Pilot, flights: int) -> list[Record]:
        """What so many flights of a controller tell of the robot; nothing of those that fail.

        They are flown without the task's pulse, which would be taken for an answer to the inputs.

        Raises
        ------
        BudgetSpent
            There is not time for all.
        """
        calm = replace(self.study.task, pulse=None)
        episodes = [self.fly(pilot, task=calm) for _ in range(flights)]
        return [episode.record for episode in episodes if episode.failure is None]

    def cost(self, episode: Episode) -> float | None:
        """J of a flight; None when it failed or was cut."""
        if episode.failure is not None or episode.cut is not None:
            return None
        J = self.study.cost.score(episode, self.study.mpc.input_scale).J
        return J if np.isfinite(J) else None

    def _check(self, duration: float) -> None:
        if self.spent + duration > self.checkpoints[-1] + _ROUNDING:
            raise BudgetSpent(f"{self.spent:g} s of {self.checkpoints[-1]:g} s are spent; {duration:g} s are needed")


def check_lent(study: Study) -> None:
    """Raises ValueError if a study asks for what a method need not know of: limits or conditions."""
    for name in ("limits", "conditions"):
        if asked := getattr(study, name):
            raise ValueError(f"the study has {name}, which only its own search keeps: take them out of it ({asked!r})")
