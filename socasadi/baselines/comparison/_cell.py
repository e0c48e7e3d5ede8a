import importlib.metadata
import time
from dataclasses import asdict
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from ...mpc import LinearMPC
from ..lab import BudgetSpent, Lab
from ._comparison import Comparison
from ._judge import open_loop_error, worth, worth_elsewhere


def fly_cell(comparison: Comparison, task: str, method: str, seed: int) -> dict[str, Any]:
    """All that a cell gives, as JSON data: what the method had to offer at each checkpoint, and what it had cost.

    What is not finite, such as J of a flight that failed, is null.
    """
    with threadpool_limits(1):  # cells are flown side by side; threads that wait for each other would take ages
        return _flown(comparison, task, method, seed)


def _flown(comparison: Comparison, task: str, method: str, seed: int) -> dict[str, Any]:
    study, began = comparison.of(task, seed), time.perf_counter()
    seconds = [at * study.task.duration for at in comparison.checkpoints]
    lab, offers, broke = Lab(study, seconds, known=comparison.study.plant), {}, None
    try:
        for pilot in comparison.methods[method].offers(lab):
            if not isinstance(getattr(pilot, "mpc", None), LinearMPC):
                raise TypeError(f"offers yields controllers, which have an mpc; not {pilot!r}")
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
        "version": importlib.metadata.version("socasadi"),
    }
    return _finite(cell)


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
