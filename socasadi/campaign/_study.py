from collections.abc import Callable
from dataclasses import dataclass, field, replace
from numbers import Integral
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np

from ..mpc import LinearMPC, weight_matrix
from ..plant import Plant
from ..tune import Optimizer, Search, SobolSearch, Space
from ._absent import AbsentPlant
from ._campaign import run_campaign
from ._result import Result
from .execution import Progress, print_progress
from .experiment import Cost, Task
from .store import ForeignTypeError, describe, rebuild

_MEMBERS = ("sample_time", "inputs", "outputs", "tension", "reset", "step")

SearchName = Literal["bayesian", "paper", "sobol"]


@dataclass(frozen=True)
class Study:
    """A question: which theta makes this MPC perform this task best on this robot?

    Parameters
    ----------
    plant
        The robot, simulated or real.
    mpc
        The controller, open in its prediction model.
    task, cost
        What it has to do, and how that is judged.
    seed_points
        Trials at Sobol points before the first model of J.
    iterations
        Trials after them.
    seed
        Of all random numbers: the search's and the sensor's.
    search
        ``"bayesian"``, the best search there is here; ``"paper"``, the settings of arXiv 2210.08780;
        ``"sobol"``, space-filling points only, the baseline.
    verifications
        Flights of the best controller under fresh noise after the search (and as many of the identified one), which say
        what it is worth without the luck of its trial. 0 spares a real robot these experiments.
    time_limit
        s of wall time after which a trial has failed.

    Raises
    ------
    ValueError
        The parts do not fit each other, or a number is out of its range.
    """

    plant: Plant
    mpc: LinearMPC
    task: Task
    cost: Cost = field(default_factory=Cost)
    seed_points: int = 10
    iterations: int = 100
    seed: int = 0
    search: SearchName = "bayesian"
    verifications: int = 5
    time_limit: float = 60.0

    def __post_init__(self) -> None:
        kinds = {"plant": Plant, "mpc": LinearMPC, "task": Task, "cost": Cost}
        for name, kind in kinds.items():
            if not isinstance(getattr(self, name), kind):
                missing = sorted(m for m in _MEMBERS if not hasattr(self.plant, m)) if name == "plant" else []
                lacks = f": it lacks {', '.join(missing)}" if missing else ""
                raise TypeError(f"{name} of a study is a {kind.__name__}, not {getattr(self, name)!r}{lacks}")
        plant, mpc = self.plant, self.mpc
        for name, of_plant, of_mpc in (
            ("inputs", plant.inputs, mpc.inputs),
            ("outputs", plant.outputs, mpc.outputs),
            ("sample_time", plant.sample_time, mpc.sample_time),
        ):
            if of_plant != of_mpc:
                raise ValueError(f"{name} of the plant is {of_plant}, but {of_mpc} of the MPC; make them equal")
        # Looked for in the class, too: it need not have a value before the first reset.
        if mpc.measured_disturbances and not (hasattr(type(plant), "disturbance") or hasattr(plant, "disturbance")):
            raise ValueError(
                f"the MPC has {mpc.measured_disturbances} measured disturbances, but the plant has no `disturbance`"
            )
        for name, least in (("seed_points", 1), ("iterations", 0), ("seed", 0), ("verifications", 0)):
            value = getattr(self, name)
            if not isinstance(value, Integral) or value < least:
                raise ValueError(f"{name} is an integer of at least {least}, not {value!r}")
        if not (isinstance(self.time_limit, int | float) and self.time_limit > 0):
            raise ValueError(f"time_limit must be positive, not {self.time_limit!r} s")
        if self.search not in get_args(SearchName):
            raise ValueError(f"unknown search {self.search!r}; there are {', '.join(get_args(SearchName))}")
        rows = np.asarray(self.task.reference(np.zeros(1)))
        if rows.shape != (1, mpc.outputs):
            raise ValueError(
                f"the task's reference has shape {rows.shape} for one instant; (1, {mpc.outputs}) is needed"
            )
        self.task.samples(mpc.sample_time)
        weight_matrix(self.cost.Q, mpc.outputs, "Q of the cost")
        weight_matrix(self.cost.R, mpc.inputs, "R of the cost")
        Space(mpc.model.entries)

    @property
    def trials(self) -> int:
        """Number of trials in all."""
        return self.seed_points + self.iterations

    @property
    def settings(self) -> dict[str, Any]:
        """Every setting as plain data; :meth:`from_settings` reads it back."""
        return describe(self)

    @classmethod
    def from_settings(cls, settings: dict[str, Any]) -> "Study":
        """The study that ``settings`` describe.

        A robot that a study script defines is stood for by one that cannot be flown; any other part of that kind
        raises :class:`ForeignTypeError`.
        """
        parts = {name: rebuild(value) for name, value in settings.items() if name not in ("type", "plant")}
        try:
            plant = rebuild(settings["plant"])
        except ForeignTypeError:
            mpc = parts["mpc"]
            plant = AbsentPlant(settings["plant"]["type"], mpc.sample_time, mpc.inputs, mpc.outputs)
        return cls(plant=plant, **parts)

    def optimizer(self) -> Search:
        """A fresh search, before any trial."""
        space = Space(self.mpc.model.entries)
        match self.search:
            case "bayesian":
                return Optimizer(space, seed=self.seed, seed_points=self.seed_points)
            case "paper":
                return Optimizer.paper(space, self.seed, seed_points=self.seed_points)
            case "sobol":
                return SobolSearch(space, self.seed)

    def sobol_only(self) -> "Study":
        """The baseline: as many trials, all at points of the Sobol sequence."""
        return replace(self, search="sobol")

    def run(
        self,
        folder: str | Path,
        *,
        resume: bool = False,
        progress: Callable[[Progress], None] | None = print_progress,
    ) -> Result:
        """Run all trials, each stored in ``folder`` before the next is asked.

        Parameters
        ----------
        folder
            The run folder: journal.sqlite and study.json come into it.
        resume
            Go on with the run that ``folder`` holds, if it holds one. The same points are asked as without a stop.
        progress
            Called after each trial; None for silence.

        Raises
        ------
        RunError
            ``folder`` is there (without ``resume``), or holds a run with other settings; the message names them.
            ``iterations`` and ``verifications`` may differ.
        JournalError
            Its journal is damaged, or another process is writing it.
        """
        return run_campaign(self, Path(folder), resume=resume, progress=progress)
