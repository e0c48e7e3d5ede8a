"""What the cells of a comparison say, in numbers."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

Cell = Mapping[str, Any]


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
        grouped: dict[tuple[str, str], list[Cell]] = {}
        for cell in sorted(cells, key=lambda cell: cell["seed"]):
            grouped.setdefault((cell["task"], cell["method"]), []).append(cell)
        points = next((tuple(cell["checkpoints"]) for group in grouped.values() for cell in group), ())
        return cls(tuple(tasks), tuple(methods), grouped, points)

    def of_pair(self, task: str, method: str) -> Sequence[Cell]:
        """The cells of a task and a method, one a seed."""
        return self.cells.get((task, method), ())

    def values(self, task: str, method: str, name: str, checkpoint: int = -1) -> np.ndarray:
        """A quantity (seeds,) at a checkpoint by its index: medians over flights; infinite where there is none."""
        points = [cell["points"][checkpoint] for cell in self.of_pair(task, method)]
        return np.array([np.inf if point is None else _median(point[name]) for point in points])

    def over_time(self, task: str, method: str, name: str = "J") -> np.ndarray:
        """Quartiles (checkpoints, 3) over the seeds; those of infinite values are infinite."""
        rows = [self.values(task, method, name, i) for i in range(len(self.checkpoints))]
        return np.array([np.quantile(row, (0.25, 0.5, 0.75), method="nearest") for row in rows])

    def rivalry(self, method: str, checkpoint: int = -1) -> tuple[int, int, float]:
        """How the first method stands against another, in J: tasks that it wins in the median, tasks, and p.

        p is that of Wilcoxon's signed-rank test over all pairs of task and seed, on the logarithm of their quotient, of
        there being no difference; NaN where there are fewer than six pairs.
        """
        from scipy.stats import wilcoxon  # takes its time to import

        first, won, ratios = self.methods[0], 0, []
        tasks = [task for task in self.tasks if self.of_pair(task, first) and self.of_pair(task, method)]
        for task in tasks:
            ours, theirs = (self.values(task, name, "J", checkpoint) for name in (first, method))
            won += bool(np.median(ours) <= np.median(theirs))
            for a, b in zip(ours, theirs, strict=False):
                if np.isfinite(a) or np.isfinite(b):
                    ratios.append(np.clip(np.log(a) - np.log(b), -50, 50))
        if len(ratios) < 6 or not np.any(ratios):
            return won, len(tasks), np.nan
        return won, len(tasks), float(wilcoxon(ratios)[1])  # pyright: ignore[reportArgumentType]

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


def summary_table(summary: Summary, checkpoint: int = -1) -> list[dict[str, str]]:
    """One row a task and method: texts by heading, medians over flights and seeds."""
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
            steps = [f"{1e6 * t:,.0f}" for t in np.median(solve, axis=0)] if len(solve) else ["-"] * 3
            rows.append(
                {
                    "task": task,
                    "method": method,
                    "knows": cells[0]["information"],
                    "robot / s": told("spent", form=".0f"),
                    "J": told("J"),
                    "RMSE / mm": told("rmse", 1e3),
                    "settled / mm": told("settled", 1e3),
                    "violated / %": told("violated", 1e2),
                    "effort / %": told("effort", 1e2),
                    "step p50 / us": steps[0],
                    "p99 / us": steps[1],
                    "max / us": steps[2],
                    "failed": f"{sum(c['failed'] for c in cells)} of {sum(c['flights'] for c in cells)}",
                    "open loop / mm": _open_loop(cells),
                }
            )
    return rows


def _open_loop(cells: Sequence[Cell]) -> str:
    errors = [cell["open_loop"] for cell in cells if cell["open_loop"] is not None]
    return f"{1e3 * np.median(errors):.3g}" if errors else "-"
