import importlib.metadata
import time
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from ...campaign import Pilot, Study
from ...mpc import LinearMPC
from ..lab import BudgetSpent, Lab
from ._comparison import Comparison
from ._judge import Elsewhere, open_loop_error, worth, worth_elsewhere


def fly_cell(comparison: Comparison, task: str, method: str, seed: int) -> dict[str, Any]:
    """All that a cell gives, as JSON data: what the method had to offer at each checkpoint, and what it had cost.

    What is not finite, such as J of a flight that failed, is null.
    """
    with threadpool_limits(1):  # cells are flown side by side; threads that wait for each other would take ages
        return _flown(comparison, task, method, seed)


def _flown(comparison: Comparison, task: str, method: str, seed: int) -> dict[str, Any]:
    study, began = comparison.of(task, seed), time.perf_counter()
    seconds = [at * study.task.duration for at in comparison.checkpoints]
    lab = Lab(study, seconds, known=comparison.study.plant)
    judged = _Judged([None] * len(seconds), np.zeros((0, study.mpc.outputs)), {}, np.nan)
    offers, broke = {}, None
    others = comparison.elsewhere if task in comparison.elsewhere_on else {}
    try:
        for pilot in comparison.methods[method].offers(lab):
            _check_offer(pilot, offers.get(seconds[-1]))
            offers |= {at: (pilot, lab.spent) for at in seconds if at >= lab.spent - 1e-9}
    except BudgetSpent:
        pass
    except ModuleNotFoundError:  # of the machine, not of the method
        raise
    except Exception as error:  # a method that cannot is a result; the others go on
        broke = f"{type(error).__name__}: {error}"
    try:
        judged = _judged(study, [offers.get(at) for at in seconds], comparison.flights, others)
    except Exception as error:
        broke = broke or f"{type(error).__name__}: {error}"
    cell = {
        "digest": comparison.digest(task, method, seed),
        "task": task,
        "method": method,
        "seed": seed,
        "information": comparison.methods[method].information,
        "episode": study.task.duration,
        "checkpoints": list(comparison.checkpoints),
        "points": judged.points,
        "path": np.round(judged.path, 5).tolist() if seed == comparison.seeds[0] else [],
        "elsewhere": judged.elsewhere,
        "open_loop": judged.open_loop,
        "flights": lab.flights,
        "failed": lab.failed,
        "spent": lab.spent,
        "broke": broke,
        "wall": time.perf_counter() - began,
        "version": importlib.metadata.version("socasadi"),
    }
    return _finite(cell)


def _check_offer(pilot: Any, last: tuple[Pilot, float] | None) -> None:
    lacks = [name for name in ("mpc", "info", "reset", "step") if not hasattr(pilot, name)]
    if lacks or not isinstance(pilot.mpc, LinearMPC):
        raise TypeError(
            f"offers yields controllers, which have {', '.join(lacks) or 'a LinearMPC as mpc'}; not {pilot!r}"
        )
    if last is not None and pilot is last[0]:
        raise TypeError(
            "offers yields the same controller twice: make a new one each time, for an earlier checkpoint has the first"
        )


@dataclass(frozen=True)
class _Judged:
    """What is thought of offers: ``points`` at the checkpoints, the last one's true path, J elsewhere and its model."""

    points: list[dict[str, Any] | None]
    path: np.ndarray
    elsewhere: dict[str, dict[str, Any]]
    open_loop: float


def _judged(study: Study, offers: list[tuple[Pilot, float] | None], flights: int, others: Elsewhere) -> _Judged:
    """Of the offer at each checkpoint, with the robot's time that it had taken, s."""
    known: dict[int, dict[str, Any]] = {}
    points, path = [], np.zeros((0, study.mpc.outputs))
    for offer in offers:
        if offer is not None and id(offer[0]) not in known:
            value, path = worth(study, offer[0], flights)
            known[id(offer[0])] = asdict(value) | {"spent": offer[1]}
        points.append(None if offer is None else known[id(offer[0])])
    if offers[-1] is None:
        return _Judged(points, path, {}, np.nan)
    pilot = offers[-1][0]
    elsewhere = {name: asdict(value) for name, value in worth_elsewhere(study, pilot, flights, others).items()}
    return _Judged(points, path, elsewhere, open_loop_error(study, pilot))


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
