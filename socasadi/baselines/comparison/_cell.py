import importlib.metadata
import time
import traceback
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from ...campaign import Pilot, Study
from ...mpc import LinearMPC
from ..lab import BudgetSpent, Lab, offers_of
from ._comparison import Comparison
from ._judge import open_loop_error, worth, worth_elsewhere
from ._own import is_own


def fly_cell(comparison: Comparison, task: str, method: str, seed: int) -> dict[str, Any]:
    """All that a cell gives, as JSON data: what the method had to offer at each checkpoint, and what it had cost.

    What is not finite, such as J of a flight that failed, is null.
    """
    with threadpool_limits(1):  # cells are flown side by side; threads that wait for each other would take ages
        return _flown(comparison, task, method, seed)


def _flown(comparison: Comparison, task: str, method: str, seed: int) -> dict[str, Any]:
    study, began, digest = comparison.of(task, seed), time.perf_counter(), comparison.digest(task, method, seed)
    seconds = [at * study.task.duration for at in comparison.checkpoints]
    lab = Lab(study, seconds, known=comparison.study.plant)
    offers, broke, lacking = {}, None, "it offered none"
    try:
        for pilot in offers_of(comparison.methods[method], lab):
            _check_offer(pilot, study, offers.get(seconds[-1]))
            offers |= {at: (pilot, lab.spent) for at in seconds if at >= lab.spent - 1e-9}
    except BudgetSpent as error:
        lacking = str(error)
    except ModuleNotFoundError:  # of the machine, not of the method
        raise
    except Exception as error:  # a method that cannot is a result; the others go on
        broke = _told(error)
    points, path, elsewhere, open_loop = [None] * len(seconds), np.zeros((0, study.mpc.outputs)), {}, np.nan
    try:
        points, path = _judged(study, [offers.get(at) for at in seconds], comparison.flights)
        if (last := offers.get(seconds[-1])) is not None:
            open_loop = open_loop_error(study, last[0])
            others = comparison.elsewhere if task in comparison.elsewhere_on else {}
            told = worth_elsewhere(study, last[0], comparison.flights, others)
            elsewhere = {name: asdict(value) for name, value in told.items()}
    except ModuleNotFoundError:
        raise
    except Exception as error:
        broke = broke or _told(error)
    cell = {
        "digest": digest,
        "task": task,
        "method": method,
        "seed": seed,
        "information": comparison.methods[method].information,
        "episode": study.task.duration,
        "checkpoints": list(comparison.checkpoints),
        "points": points,
        "path": np.round(path, 7).tolist() if seed == comparison.seeds[0] else [],
        "elsewhere": elsewhere,
        "open_loop": open_loop,
        "flights": lab.flights,
        "failed": lab.failed,
        "spent": lab.spent,
        "broke": broke,
        "lacking": None if offers else lab.failures or lacking,
        "wall": time.perf_counter() - began,
        "version": importlib.metadata.version("socasadi"),
    }
    return _finite(cell)


def _told(error: Exception) -> str:
    """What went wrong, and where in files of one's own."""
    own = [frame for frame in traceback.extract_tb(error.__traceback__) if is_own(frame.filename)]
    place = f" ({Path(own[-1].filename).name}, line {own[-1].lineno})" if own else ""
    return f"{type(error).__name__}: {error}{place}"


def _check_offer(pilot: Any, study: Study, last: tuple[Pilot, float] | None) -> None:
    lacks = [name for name in ("mpc", "info", "reset", "step") if not hasattr(pilot, name)]
    if lacks or not isinstance(pilot.mpc, LinearMPC):
        raise TypeError(
            f"offers yields controllers, which have {', '.join(lacks) or 'a LinearMPC as mpc'}; not {_short(pilot)}"
        )
    if pilot.mpc.sample_time != study.mpc.sample_time:
        raise ValueError(
            f"a controller has samples of {pilot.mpc.sample_time:g} s, the study {study.mpc.sample_time:g} s"
        )
    if last is not None and pilot is last[0]:
        raise TypeError(
            "offers yields the same controller twice: make a new one each time, for an earlier checkpoint has the first"
        )


def _short(value: Any) -> str:
    text = " ".join(repr(value).split())
    return text if len(text) <= 80 else f"{text[:77]}..."


def _judged(
    study: Study, offers: list[tuple[Pilot, float] | None], flights: int
) -> tuple[list[dict[str, Any] | None], np.ndarray]:
    """What each offer is worth, with the robot's time that it had taken, s; and the last one's true path."""
    known: dict[int, dict[str, Any]] = {}
    points, path = [], np.zeros((0, study.mpc.outputs))
    for offer in offers:
        if offer is not None and id(offer[0]) not in known:
            value, path = worth(study, offer[0], flights)
            known[id(offer[0])] = asdict(value) | {"spent": offer[1]}
        points.append(None if offer is None else known[id(offer[0])])
    return points, path


def _finite(value: Any) -> Any:
    """JSON data, numbers to seven digits, in which what is not a finite number is null."""
    match value:
        case dict():
            return {key: _finite(item) for key, item in value.items()}
        case list() | tuple():
            return [_finite(item) for item in value]
        case float():
            return float(f"{value:.7g}") if np.isfinite(value) else None
    return value
