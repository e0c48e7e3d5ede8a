import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal, get_args

from ...campaign import Study, Task
from ...campaign.store import describe
from ..lab import Method
from ._check import check_comparison
from ._judge import Elsewhere
from ._own import own_code

Size = Literal["smoke", "quick", "full"]

_SCHEMA = 3
"""Raised when a method of the package, or what a cell holds, is reckoned in another way: all are flown again."""
_SMOKE = 5.0
"""s of a flight, at most, of the smallest size."""
_NO_LIMIT = 1e8
"""s of wall time for a flight: a slow method, or a busy machine, is no failure."""


@dataclass(frozen=True)
class Comparison:
    """Which methods are compared, on what, and how long.

    Parameters
    ----------
    study
        Robot, MPC and cost that all have in common. Its own task, seed and limit of wall time are not used.
    tasks
        By name: a task, or a study of its own where the robot is another. Methods that take the plant's model are given
        that of ``study`` all the same: they do not know what is different.
    methods
        By name.
    seeds
        Each a repetition of all, with other random numbers.
    checkpoints
        After how many episodes' worth of the robot's time a method is asked for its controller; ascending.
    flights
        Of each controller that is judged, under noise that no method has seen.
    elsewhere
        Other robots by name, on which the last controllers of all methods are flown.
    elsewhere_on
        The tasks for which they are.
    shown
        Methods that figures with lines pick out, whose others are grey. None given: the first one, and of the others
        some from the best to the worst.

    Raises
    ------
    ValueError
        Nothing is compared, or a setting is out of its range; the message names it and its value.
    TypeError
        A part is of another type.
    """

    study: Study
    tasks: Mapping[str, Task | Study]
    methods: Mapping[str, Method]
    seeds: Sequence[int] = tuple(range(10))
    checkpoints: Sequence[int] = (1, 2, 3, 5, 10, 20, 30, 60, 110)
    flights: int = 5
    elsewhere: Elsewhere = field(default_factory=dict)
    elsewhere_on: Sequence[str] = ()
    shown: Sequence[str] = ()

    def __post_init__(self) -> None:
        check_comparison(self)

    def of_size(self, size: Size) -> "Comparison":
        """The comparison as it is (``"full"``), or less of it.

        ``"quick"``: the first three seeds, checkpoints up to 30, three flights. ``"smoke"``, whether it works at all:
        one seed, the first two tasks for 5 s at most, checkpoints up to 20, one flight, one other robot.
        """
        match size:
            case "full":
                return self
            case "quick":
                points = tuple(at for at in self.checkpoints if at <= 30) or tuple(self.checkpoints[:1])
                return replace(self, seeds=tuple(self.seeds)[:3], checkpoints=points, flights=min(self.flights, 3))
            case "smoke":
                tasks = {name: self._short(name) for name in list(self.tasks)[:2]}
                points = tuple(at for at in self.checkpoints if at <= 20) or tuple(self.checkpoints[:1])
                few = {"seeds": tuple(self.seeds)[:1], "checkpoints": points, "flights": 1}
                others = dict(list(self.elsewhere.items())[:1])
                return replace(self, **few, **self._only(tasks, others))
        raise ValueError(f"a comparison is of size {', '.join(get_args(Size))}, not {size!r}")

    def of_parts(
        self, tasks: Sequence[str] = (), methods: Sequence[str] = (), seeds: int | None = None
    ) -> "Comparison":
        """Some of its tasks and methods, and the first so many of its seeds; none given is all.

        Raises
        ------
        ValueError
            There is no such task or method, or there are not so many seeds.
        """
        count = len(self.seeds) if seeds is None else seeds
        if not 1 <= count <= len(self.seeds):
            raise ValueError(f"the first {count} seeds are asked for, of {len(self.seeds)} that there are in this size")
        for kind, names, known in (("task", tasks, self.tasks), ("method", methods, self.methods)):
            if unknown := [name for name in names if name not in known]:
                raise ValueError(f"there is no {kind} {unknown[0]!r}; there are {', '.join(known)}")
        kept = {name: task for name, task in self.tasks.items() if not tasks or name in tasks}
        flown = {name: method for name, method in self.methods.items() if not methods or name in methods}
        shown = tuple(name for name in self.shown if name in flown)
        part = {"methods": flown, "shown": shown, "seeds": tuple(self.seeds)[:count]}
        return replace(self, **part, **self._only(kept, self.elsewhere))

    def of(self, task: str, seed: int) -> Study:
        """The study of a task and a seed, its flights without a limit of wall time."""
        given = self.tasks[task]
        study = given if isinstance(given, Study) else replace(self.study, task=given)
        return replace(study, seed=int(seed), time_limit=_NO_LIMIT)

    @property
    def extent(self) -> str:
        """How much is flown, in words."""
        counts = {"method": len(self.methods), "task": len(self.tasks), "seed": len(self.seeds), "flight": self.flights}
        told = ", ".join(f"{count} {name}{'s' * (count != 1)}" for name, count in counts.items())
        return f"{told} each, {self.checkpoints[-1]} episodes' worth of the robot's time"

    @property
    def cells(self) -> list[tuple[str, str, int]]:
        """Task, method and seed of all that is flown, seed by seed."""
        return [(task, method, int(seed)) for seed in self.seeds for task in self.tasks for method in self.methods]

    def digest(self, task: str, method: str, seed: int) -> str:
        """What tells a cell from the same one under other settings."""
        parts = {
            "schema": _SCHEMA,
            "study": self.of(task, seed).settings,
            "method": describe(self.methods[method]),
            "own code": [own_code(part) for part in (self.methods[method], self.of(task, seed))],
            "checkpoints": list(self.checkpoints),
            "flights": self.flights,
            "elsewhere": [(name, describe(other), own_code(other)) for name, other in self.elsewhere.items()]
            if task in self.elsewhere_on
            else None,
        }
        return hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()[:16]

    def _only(self, tasks: Mapping[str, Task | Study], others: Elsewhere) -> dict[str, Any]:
        on = tuple(name for name in self.elsewhere_on if name in tasks)
        return {"tasks": tasks, "elsewhere_on": on, "elsewhere": others if on else {}}

    def _short(self, task: str) -> Task | Study:
        given = self.tasks[task]
        long = given.task if isinstance(given, Study) else given
        duration, pulse = min(_SMOKE, long.duration), long.pulse
        short = replace(long, duration=duration, pulse=pulse if pulse and pulse.time < duration / 2 else None)
        return replace(given, task=short) if isinstance(given, Study) else short
