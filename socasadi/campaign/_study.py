from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field, replace
from numbers import Integral, Real
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import ArrayLike

from ..mpc import LinearMPC, weight_matrix
from ..plant import ExternalPlant, Plant
from ..tune import Optimizer, Search, SobolSearch, Space
from ._result import Result
from .execution import Progress, print_progress, run_campaign
from .experiment import Condition, Cost, Limit, Task, admissible, check_conditions, check_limits
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
    initial
        Thetas that are tried first, such as a datasheet's, an identified one, or the best of an earlier run. They count
        among the seed points.
    limits
        What an episode must keep beside a low J, measured on it; the search learns where they are kept.
    conditions
        What a theta must fulfil before any experiment, computed from its controller.
    give_up
        An episode is cut as soon as its record proves that its J is above so many times the best J known when it was
        asked; None flies all to their ends, as the paper's search always does.

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
    initial: Sequence[ArrayLike] = ()
    limits: tuple[Limit, ...] = ()
    conditions: tuple[Condition, ...] = ()
    give_up: float | None = 10.0

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
        self._check_search()

    def _check_search(self) -> None:
        space = Space(self.mpc.entries)
        if len(self.initial) and self.search != "bayesian":
            raise ValueError(f"the search {self.search!r} has points of its own to start with: give no initial ones")
        if self.search == "paper" and (self.limits or self.conditions):
            raise ValueError("the search of the paper knows neither limits nor conditions: take another, or give none")
        # Tuples of numbers, so that studies can be compared whatever a theta was kept in.
        object.__setattr__(self, "initial", tuple(tuple(space.check(theta).tolist()) for theta in self.initial))
        for name, check in (("limits", check_limits), ("conditions", check_conditions)):
            object.__setattr__(self, name, tuple(getattr(self, name)))
            check(getattr(self, name), self.mpc)
        share = self.give_up
        if share is not None and not (isinstance(share, Real) and share >= 1):
            raise ValueError(f"give_up is a number of at least 1, or None, not {share!r}")

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
            plant = ExternalPlant(mpc.sample_time, mpc.inputs, mpc.outputs, name=settings["plant"]["type"])
        return cls(plant=plant, **parts)

    def optimizer(self) -> Search:
        """A fresh search, before any trial."""
        space = Space(self.mpc.entries)
        limits = {limit.name: limit.limit for limit in self.limits}
        fulfilled = admissible(self.conditions, self.mpc)
        match self.search:
            case "bayesian":
                return Optimizer(
                    space,
                    seed=self.seed,
                    seed_points=self.seed_points,
                    initial=self.initial,
                    limits=limits,
                    admissible=fulfilled,
                )
            case "paper":
                return Optimizer.paper(space, self.seed, seed_points=self.seed_points)
            case "sobol":
                return SobolSearch(space, self.seed, limits=limits, admissible=fulfilled)

    def sobol_only(self) -> "Study":
        """The baseline: as many trials, all at points of the Sobol sequence."""
        return replace(self, search="sobol", initial=())

    def run(
        self,
        folder: str | Path,
        *,
        resume: bool = False,
        progress: Callable[[Progress], None] | None = print_progress,
        jobs: int | None = None,
        executor: Executor | None = None,
        script: str | Path | None = None,
    ) -> Result:
        """Run all trials, each stored in ``folder`` before the next is asked.

        Trials that a run asked and could not finish are flown first, with their own theta and noise. Those that were
        asked by hand (:meth:`Campaign.ask`) stay with whoever asked them.

        Parameters
        ----------
        folder
            The run folder: journal.sqlite and study.json come into it.
        resume
            Go on with the run that ``folder`` holds, if it holds one. The same points are asked as without a stop.
        progress
            Called after each trial; None for silence.
        jobs
            How many trials at once; more than one are flown by as many processes, or by ``executor``. By default one,
            or as many as ``executor.jobs`` says.
        executor
            Anything with the interface of :mod:`concurrent.futures` that flies trials, such as
            :func:`dask_executor`'s; it is left open. It is sent text and answers by text.
        script
            The file that defines this study, which other processes run again when the settings alone do not make it
            (a robot of one's own, for instance); the script that Python was started with by default.

        Raises
        ------
        RunError
            ``folder`` is there (without ``resume``), or holds a run with other settings; the message names them.
            ``iterations`` and ``verifications`` may differ. Or other processes cannot make this study.
        JournalError
            Its journal is damaged, or another process is writing it.
        """
        script = None if script is None else Path(script)
        where = {"jobs": jobs, "executor": executor, "script": script}
        run_campaign(self, Path(folder), resume=resume, progress=progress, **where)
        return Result(self, Path(folder))
