"""Methods beside each other, on the same robot, tasks and seeds, at equal cost."""

import hashlib
import json
import os
import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, wait
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np
from threadpoolctl import threadpool_limits

from ..campaign import Study, Task, load_script
from ..campaign.store import RunError, describe
from ._judge import Elsewhere, open_loop_error, worth, worth_elsewhere
from ._lab import BudgetSpent, Lab
from ._method import Method

Size = Literal["smoke", "quick", "full"]

_SCHEMA = 1
_LOSSES = 2
"""Times that a cell is flown again when its worker has died."""


@dataclass(frozen=True)
class Comparison:
    """Which methods are compared, on what, and how long.

    Parameters
    ----------
    study
        Robot, MPC, cost and limits of time that all have in common. Its own task and seed are not used.
    tasks
        By name: a task, or a study of its own where the robot is another.
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

    Raises
    ------
    ValueError
        Nothing is compared, or the checkpoints do not ascend.
    """

    study: Study
    tasks: Mapping[str, Task | Study]
    methods: Mapping[str, Method]
    seeds: Sequence[int] = tuple(range(10))
    checkpoints: Sequence[int] = (1, 2, 3, 5, 10, 20, 30, 60, 110)
    flights: int = 5
    elsewhere: Elsewhere = field(default_factory=dict)
    elsewhere_on: Sequence[str] = ()

    def __post_init__(self) -> None:
        if not (self.tasks and self.methods and len(self.seeds) and len(self.checkpoints)):
            raise ValueError("a comparison takes at least one task, method, seed and checkpoint")
        if list(self.checkpoints) != sorted(set(self.checkpoints)) or self.checkpoints[0] < 1:
            raise ValueError(f"checkpoints are numbers of episodes that ascend, not {list(self.checkpoints)}")
        for name, method in self.methods.items():
            if not isinstance(method, Method):
                raise TypeError(f"the method {name!r} is a Method, not {method!r}")
        if unknown := sorted(set(self.elsewhere_on) - set(self.tasks)):
            raise ValueError(f"elsewhere_on names {unknown[0]!r}; the tasks are {', '.join(self.tasks)}")

    def of_size(self, size: Size) -> "Comparison":
        """The comparison as it is (``"full"``), or less of it.

        ``"quick"``: the first three seeds, checkpoints up to 30, three flights. ``"smoke"``, whether it works at all:
        one seed, the first two tasks for 5 s, checkpoints up to 10, one flight, one other robot.
        """
        match size:
            case "full":
                return self
            case "quick":
                points = tuple(at for at in self.checkpoints if at <= 30) or tuple(self.checkpoints[:1])
                return replace(self, seeds=tuple(self.seeds)[:3], checkpoints=points, flights=min(self.flights, 3))
            case "smoke":
                tasks = {name: self._short(name) for name in list(self.tasks)[:2]}
                points = tuple(at for at in self.checkpoints if at <= 10) or tuple(self.checkpoints[:1])
                few = {"seeds": tuple(self.seeds)[:1], "checkpoints": points, "flights": 1}
                others = dict(list(self.elsewhere.items())[:1])
                on = tuple(name for name in self.elsewhere_on if name in tasks)
                return replace(self, tasks=tasks, **few, elsewhere=others, elsewhere_on=on)
        raise ValueError(f"a comparison is of size {', '.join(get_args(Size))}, not {size!r}")

    def of(self, task: str, seed: int) -> Study:
        """The study of a task and a seed."""
        given = self.tasks[task]
        study = given if isinstance(given, Study) else replace(self.study, task=given)
        return replace(study, seed=int(seed))

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
            "checkpoints": list(self.checkpoints),
            "flights": self.flights,
            "elsewhere": describe(dict(self.elsewhere)) if task in self.elsewhere_on else None,
        }
        return hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()[:16]

    def _short(self, task: str) -> Task | Study:
        given = self.tasks[task]
        if isinstance(given, Study):
            return replace(given, task=replace(given.task, duration=5.0))
        return replace(given, duration=5.0)


def fly_cell(comparison: Comparison, task: str, method: str, seed: int) -> dict[str, Any]:
    """All that a cell gives, as JSON data: what the method had to offer at each checkpoint, and what it had cost.

    What is not finite, such as J of a flight that failed, is null.
    """
    with threadpool_limits(1):  # cells are flown side by side; threads that wait for each other would take ages
        return _flown(comparison, task, method, seed)


def _flown(comparison: Comparison, task: str, method: str, seed: int) -> dict[str, Any]:
    study, began = comparison.of(task, seed), time.perf_counter()
    seconds = [at * study.task.duration for at in comparison.checkpoints]
    lab, offers, broke = Lab(study, seconds), {}, None
    try:
        for pilot in comparison.methods[method].offers(lab):
            offers |= {at: (pilot, lab.spent) for at in seconds if at >= lab.spent - 1e-9}
    except BudgetSpent:
        pass
    except ModuleNotFoundError:  # of the machine, not of the method
        raise
    except Exception as error:  # a method that cannot is a result; the others go on
        broke = f"{type(error).__name__}: {error}"
    judged: dict[int, dict[str, Any]] = {}
    points, path = [], np.zeros((0, study.mpc.outputs))
    for at in seconds:
        if at not in offers:
            points.append(None)
            continue
        pilot, spent = offers[at]
        if id(pilot) not in judged:
            value, path = worth(study, pilot, comparison.flights)
            judged[id(pilot)] = asdict(value) | {"spent": spent}
        points.append(judged[id(pilot)])
    last = offers.get(seconds[-1])
    others = comparison.elsewhere if last and task in comparison.elsewhere_on else {}
    cell = {
        "digest": comparison.digest(task, method, seed),
        "task": task,
        "method": method,
        "seed": seed,
        "information": comparison.methods[method].information,
        "episode": study.task.duration,
        "checkpoints": list(comparison.checkpoints),
        "points": points,
        "path": np.round(path, 5).tolist() if seed == comparison.seeds[0] else [],
        "elsewhere": {
            name: asdict(value) for name, value in worth_elsewhere(study, last[0], comparison.flights, others).items()
        }
        if last
        else {},
        "open_loop": open_loop_error(study, last[0]) if last else np.nan,
        "flights": lab.flights,
        "failed": lab.failed,
        "spent": lab.spent,
        "broke": broke,
        "wall": time.perf_counter() - began,
    }
    return _finite(cell)


def _finite(value: Any) -> Any:
    """JSON data in which what is not a finite number is null."""
    match value:
        case dict():
            return {key: _finite(item) for key, item in value.items()}
        case list() | tuple():
            return [_finite(item) for item in value]
        case float() if not np.isfinite(value):
            return None
    return value


def load_comparison(script: Path, size: Size = "full") -> Comparison:
    """The ``comparison`` that a script defines, in a size.

    Raises
    ------
    RunError
        There is no such file, it breaks off (the message says where), or it defines no comparison.
    """
    found = load_script(script).get("comparison")
    if not isinstance(found, Comparison):
        raise RunError(f"{script} defines no `comparison`: let it make one, comparison = Comparison(study=..., ...)")
    return found.of_size(size)


def order_cell(script: str, size: Size, task: str, method: str, seed: int) -> str:
    """:func:`fly_cell` in another process, which runs the script again; JSON."""
    key = script, size
    if key not in _loaded:
        _loaded[key] = load_comparison(Path(script), size)
    return json.dumps(fly_cell(_loaded[key], task, method, seed))


_loaded: dict[tuple[str, str], Comparison] = {}


def run_comparison(
    script: Path,
    size: Size,
    folder: Path,
    executor: Executor,
    progress: Callable[[dict[str, Any], int, int], None] = lambda cell, done, total: None,
) -> list[dict[str, Any]]:
    """Fly all cells that ``folder`` does not hold yet, each stored when it is done; return them all.

    Parameters
    ----------
    executor
        Where they are flown: it is sent names and answers by text.
    progress
        Is told each cell that is done, how many are, and of how many.

    Raises
    ------
    RunError
        No worker can fly a cell, or they die of one; what was done is stored.
    """
    comparison = load_comparison(script, size)
    known = {(c["task"], c["method"], c["seed"]): c for c in stored_cells(folder)}
    cells: list[dict[str, Any]] = []
    missing = []
    for task, method, seed in comparison.cells:
        cell = known.get((task, method, seed))
        if cell is not None and cell["digest"] == comparison.digest(task, method, seed):
            cells.append(cell)
        else:
            missing.append((task, method, seed))
    total, losses = len(comparison.cells), Counter()
    waiting: dict[Future, tuple[str, str, int]] = {}

    def send(names: tuple[str, str, int]) -> None:
        waiting[executor.submit(order_cell, str(script.resolve()), size, *names)] = names

    try:
        for names in missing:
            send(names)
        while waiting:
            for future in wait(waiting, return_when=FIRST_COMPLETED).done:
                names = waiting.pop(future)
                try:
                    cell = json.loads(future.result())
                except BrokenExecutor as error:  # its worker died, of this cell or of something else
                    losses[names] += 1
                    if losses[names] > _LOSSES:
                        raise RunError(f"{', '.join(map(str, names))}: its workers die ({error})") from error
                    send(names)
                except Exception as error:
                    raise RunError(f"{', '.join(map(str, names))}: {error}") from error
                else:
                    _store(folder, cell)
                    cells.append(cell)
                    progress(cell, len(cells), total)
    finally:
        for future in waiting:
            future.cancel()
    return cells


def stored_cells(folder: Path) -> Iterator[dict[str, Any]]:
    """The cells that a folder holds; what is no cell is left out."""
    for file in sorted(folder.glob("*/*.json")):
        try:
            cell = json.loads(file.read_text(encoding="utf-8"))
        except (OSError, ValueError):
            continue
        if isinstance(cell, dict) and "digest" in cell:
            yield cell


def _store(folder: Path, cell: dict[str, Any]) -> None:
    name = "".join(c if c.isalnum() else "-" for c in cell["method"])
    file = folder / cell["task"].replace(" ", "-") / f"{name}-{cell['seed']}.json"
    file.parent.mkdir(parents=True, exist_ok=True)
    part = file.with_name(f"{file.name}.part")
    part.write_text(json.dumps(cell), encoding="utf-8")
    os.replace(part, file)
