"""Regret against evaluations, a panel for each problem."""

from collections.abc import Sequence
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from .tune_compare import Table
from .tune_runs import SEED_POINTS
from .tune_search import METHODS

# Told apart by lightness and by dashes as well as by hue; this package's own searches are black and solid or dotted.
STYLES = {
    "random": ("#b8b8b8", "-"),
    "optuna-tpe": ("#d9b300", (0, (6, 1.5))),
    "optuna-gp": ("#e07b00", (0, (9, 2))),
    "bayes-opt": ("#7fbf7b", (0, (1, 1))),
    "skopt": ("#1b7837", (0, (4, 1.5, 1, 1.5))),
    "smac": ("#c51b7d", (0, (2.5, 1.5))),
    "botorch": ("#2166ac", "-"),
    "botorch-log": ("#67a9cf", (0, (5, 1, 1, 1))),
    "paper": ("#000000", (0, (1, 1.5))),
    "socasadi": ("#000000", "-"),
}


def draw(tables: Sequence[Table], path: Path) -> None:
    """Medians as lines; quartiles as whiskers at the last evaluation and, of ours alone, as a band: many overlap."""
    columns = min(4, len(tables) + 1)
    rows = -(-(len(tables) + 1) // columns)
    figure, grid = plt.subplots(rows, columns, figsize=(3.6 * columns, 3.2 * rows), layout="constrained", squeeze=False)
    *panels, last = grid.flat[: len(tables) + 1]
    for axes, table in zip(panels, tables, strict=True):
        present = [method for method in METHODS if method in table.costs]
        for place, method in enumerate(present):
            colour, dashes = STYLES[method]
            low, median, high = table.quartiles(method)[:, SEED_POINTS - 1 :]
            x = np.arange(SEED_POINTS, SEED_POINTS + len(median))
            ours = method == "socasadi"
            width, order = (2.4, 4) if ours else (1.3, 3)
            axes.plot(x, median, color=colour, linestyle=dashes, linewidth=width, zorder=order)
            if ours:
                axes.fill_between(x, low, high, color=colour, alpha=0.15, linewidth=0)
            at = x[-1] + (1.5 + 1.3 * place) * len(x) / 90
            axes.plot([at, at], [low[-1], high[-1]], color=colour, linewidth=1.2)
            axes.plot(at, median[-1], "o", color=colour, markersize=3)
        axes.set(title=table.problem.title, xlabel="evaluations", yscale="log")
        axes.grid(alpha=0.3)
    for axes in grid[:, 0]:
        axes.set_ylabel("median regret, quartiles")
    for axes in grid.flat[len(tables) :]:
        axes.axis("off")
    shown = [method for method in METHODS if any(method in table.costs for table in tables)]
    for method in reversed(shown):
        colour, dashes = STYLES[method]
        last.plot([], [], color=colour, linestyle=dashes, linewidth=2, label=METHODS[method].title)
    last.legend(loc="center", frameon=False, handlelength=4)
    path.parent.mkdir(exist_ok=True)
    figure.savefig(path, dpi=110)
    plt.close(figure)
