"""What the cells of a comparison say, in numbers."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

Cell = Mapping[str, Any]


_FEWEST = 6
"""Seeds without which there is no rank test: of five all with one sign p is 0.06."""
_HUGE = 1e300
"""Stands for infinity where a mean of two is taken."""


@dataclass(frozen=True)
class Rivalry:
    """How the first method stands against another, in J.

    Attributes
    ----------
    won, tasks
        Tasks on which its median over the seeds that both have flown is no higher, of those on which either has a J.
    excess
        By what share the other's J is higher: quartiles over the seeds of the geometric mean over the tasks, without
        those on which neither has a J; NaN without a seed that both have flown on all tasks.
    p
        Of there being no difference: Wilcoxon's signed-rank test on that mean, one number a seed (tasks of one seed
        share noise and probing record, and do not count as several), corrected for the number of rivals after Holm;
        NaN with fewer than six seeds.
    """

    won: int
    tasks: int
    excess: tuple[float, float, float]
    p: float


@dataclass(frozen=True, eq=False)
class Summary:
    """Cells in order.

    Attributes
    ----------
    tasks, methods
        Names, in the order of the comparison; the first method is the one that the others are compared with.
    cells
        By task and method, a list over seeds.
    checkpoints
        Episodes' worth of the robot's time.
    """

    tasks: tuple[str, ...]
    methods: tuple[str, ...]
    cells: Mapping[tuple[str, str], Sequence[Cell]]
    checkpoints: tuple[int, ...]

    @classmethod
    def of(cls, cells: Iterable[Cell], tasks: Sequence[str], methods: Sequence[str]) -> "Summary":
        """Of several cells of one task, method and seed the last counts."""
        last = {(cell["task"], cell["method"], cell["seed"]): cell for cell in cells}
        grouped: dict[tuple[str, str], list[Cell]] = {}
        for task, method, seed in sorted(last):
            grouped.setdefault((task, method), []).append(last[task, method, seed])
        points = next((tuple(cell["checkpoints"]) for cell in last.values()), ())
        return cls(tuple(tasks), tuple(methods), grouped, points)

    @property
    def seeds(self) -> tuple[int, ...]:
        """Those of which there is anything."""
        return tuple(sorted({cell["seed"] for group in self.cells.values() for cell in group}))

    def of_pair(self, task: str, method: str) -> Sequence[Cell]:
        """The cells of a task and a method, one a seed."""
        return self.cells.get((task, method), ())

    def values(self, task: str, method: str, name: str, checkpoint: int = -1) -> np.ndarray:
        """A quantity (seeds,) at a checkpoint by its index: medians over flights; infinite where there is none."""
        points = [cell["points"][checkpoint] for cell in self.of_pair(task, method)]
        return np.array([np.inf if point is None else _median(point[name]) for point in points])

    def over_time(self, task: str, method: str, name: str = "J") -> np.ndarray:
        """Quartiles (checkpoints, 3) over the seeds; those of infinite values are infinite."""
        return np.array([_quartiles(self.values(task, method, name, i)) for i in range(len(self.checkpoints))])

    def rivalries(self, checkpoint: int = -1) -> dict[str, Rivalry]:
        """How the first method stands against each other one, in J at a checkpoint by its index."""
        rivals = {method: self._rivalry(method, checkpoint) for method in self.methods[1:]}
        rivals = {method: rivalry for method, rivalry in rivals.items() if rivalry.tasks}
        # Holm's correction for several tests, the least p first.
        tested = sorted((name for name in rivals if np.isfinite(rivals[name].p)), key=lambda name: rivals[name].p)
        held = 0.0
        for i, name in enumerate(tested):
            held = max(held, min(1.0, (len(tested) - i) * rivals[name].p))
            rivals[name] = replace(rivals[name], p=held)
        return rivals

    def _rivalry(self, method: str, checkpoint: int) -> Rivalry:
        """Without a correction of p."""
        from scipy.stats import wilcoxon  # takes its time to import

        first = self.methods[0]
        won, tasks, quotients = 0, 0, []
        for task in self.tasks:
            ours, theirs = (
                dict(zip((cell["seed"] for cell in self.of_pair(task, name)), values, strict=True))
                for name in (first, method)
                for values in [self.values(task, name, "J", checkpoint)]
            )
            if not (both := [seed for seed in ours if seed in theirs]):
                continue
            quotients.append({seed: _log_quotient(theirs[seed], ours[seed]) for seed in both})
            if np.isfinite(list(quotients[-1].values())).any():
                tasks += 1
                won += bool(np.median([ours[s] for s in both]) <= np.median([theirs[s] for s in both]))
        seeds = [seed for seed in (quotients[0] if quotients else ()) if all(seed in row for row in quotients)]
        of_seeds = np.array([[row[seed] for row in quotients] for seed in seeds]).reshape(len(seeds), len(quotients))
        means = np.array([np.nanmean(row) for row in of_seeds if np.isfinite(row).any()])
        tested = len(means) >= _FEWEST and np.any(means)
        p = float(wilcoxon(means)[1]) if tested else np.nan  # pyright: ignore[reportArgumentType]
        low, middle, high = np.expm1(_quartiles(means)).tolist()
        return Rivalry(won, tasks, (low, middle, high), p)

    def elsewhere(self, task: str) -> tuple[list[str], dict[str, np.ndarray]]:
        """Names of other robots, and by method J there (robots,), medians over flights and seeds; infinite: failed."""
        names = next((list(c["elsewhere"]) for m in self.methods for c in self.of_pair(task, m) if c["elsewhere"]), [])
        told: dict[str, np.ndarray] = {}
        for method in self.methods:
            flown = [cell["elsewhere"] for cell in self.of_pair(task, method) if cell["elsewhere"]]
            if flown:
                costs = [[_median(others[name]["J"]) for name in names] for others in flown]
                told[method] = np.median(costs, axis=0)
        return names, told


def _median(value: Any) -> float:
    """Of a number or of several, of which null counts as infinite."""
    values = [np.inf if x is None else x for x in (value if isinstance(value, list) else [value])]
    return float(np.median(values))


def _quartiles(values: np.ndarray) -> tuple[float, float, float]:
    """Of values that may be infinite; NaN of none."""
    if not len(values):
        return (np.nan, np.nan, np.nan)
    parts = np.quantile(np.minimum(values, _HUGE), (0.25, 0.5, 0.75))
    low, middle, high = np.where(parts > _HUGE / 1e10, np.inf, parts).tolist()
    return low, middle, high


def _log_quotient(a: float, b: float) -> float:
    """Of two J, within bounds where one of them is infinite; NaN where both are."""
    return np.nan if np.isinf(a) and np.isinf(b) else float(np.clip(np.log(a) - np.log(b), -50, 50))


def summary_table(summary: Summary, checkpoint: int = -1) -> list[dict[str, str]]:
    """One row a task and method: texts by heading.

    They are medians over flights and seeds, but for the longest step, which is that of all, and counts of what failed:
    of the flights that were judged, and of those before, in which the method was tuned.
    """
    rows = []
    for task in summary.tasks:
        for method in summary.methods:
            cells = summary.of_pair(task, method)
            if not cells:
                continue

            def told(name: str, factor: float = 1.0, form: str = ".3g", task: str = task, method: str = method) -> str:
                value = factor * float(np.median(summary.values(task, method, name, checkpoint)))
                return format(value, form) if np.isfinite(value) else "-"

            points = [cell["points"][checkpoint] for cell in cells]
            solve = np.array([p["solve"] for p in points if p and None not in p["solve"]], dtype=float)
            typical = (*np.median(solve[:, :2], axis=0), solve[:, 2].max()) if len(solve) else ()
            steps = [f"{1e6 * t:.0f}" for t in typical] or ["-"] * 3
            flown = [J for p in points if p for J in p["J"]]
            rows.append(
                {
                    "task": task,
                    "method": method,
                    "knows": cells[0]["information"],
                    "seeds": str(len(cells)),
                    "robot / s": told("spent", form=".0f"),
                    "J": told("J"),
                    "RMSE / mm": told("rmse", 1e3),
                    "settled / mm": told("settled", 1e3),
                    "violated / %": told("violated", 1e2),
                    "effort / %": told("effort", 1e2),
                    "step p50 / us": steps[0],
                    "p99 / us": steps[1],
                    "max / us": steps[2],
                    "failed": f"{sum(J is None for J in flown)} of {len(flown)}",
                    "while tuned": f"{sum(c['failed'] for c in cells)} of {sum(c['flights'] for c in cells)}",
                    "broke": f"{sum(bool(c['broke']) for c in cells)} of {len(cells)}",
                    "open loop / mm": _open_loop(cells),
                }
            )
    return rows


def _open_loop(cells: Sequence[Cell]) -> str:
    errors = [cell["open_loop"] for cell in cells if cell["open_loop"] is not None]
    return f"{1e3 * np.median(errors):.3g}" if errors else "-"
