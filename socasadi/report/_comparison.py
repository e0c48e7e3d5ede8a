from collections.abc import Sequence
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

from ..baselines import Comparison, Size, Summary
from ..campaign import Study, Units
from ._style import BLACK, BLUE, GREY, MM, ORANGE, PAGE, SETTINGS

_COLOURS = (ORANGE, "#009E73", "#CC79A7", "#56B4E9", "#E69F00", BLACK, GREY)
_DASHES = ("-", (0, (4, 1.5)), (0, (1, 1)))
_MARKERS = "sD^vPX*"
_HIGHEST = 3.0
"""Times the least J, above which values stand on the edge."""
_HIGHEST_RMSE = 100.0
"""The same of RMSE, which spreads over decades."""


def comparison_figures(summary: Summary, comparison: Comparison, size: Size) -> dict[str, Figure]:
    """The figures of a comparison by name: cost and rmse over the robot's time, methods, paths, elsewhere.

    Parameters
    ----------
    comparison
        In its full size.
    size
        Of what was flown, which each figure says, and what it leaves out.
    """
    whole, comparison = comparison, comparison.of_size(size)
    comparison = comparison.of_parts(summary.tasks, summary.methods, len(summary.seeds))
    note = f"{size}: {comparison.extent}"
    if comparison.extent != whole.extent:
        note += f"\nThe full comparison: {whole.extent}"
    factor, unit = Units.of(comparison.study.plant).shown
    with matplotlib.rc_context(SETTINGS):
        drawn = {
            "cost": _over_time(summary, comparison, "J", 1.0, "J", _HIGHEST, note),
            "rmse": _over_time(summary, comparison, "rmse", factor, f"RMSE after 5 s / {unit}", _HIGHEST_RMSE, note),
            "methods": _methods(summary, note),
            "paths": _paths(summary, comparison, factor, unit, note),
        }
        for task in (task for task in comparison.elsewhere_on if summary.elsewhere(task)[1]):
            drawn[f"elsewhere-{task}" if len(comparison.elsewhere_on) > 1 else "elsewhere"] = _elsewhere(
                summary, task, note
            )
    return drawn


def _look(summary: Summary, method: str) -> dict[str, Any]:
    """Told apart by dashes and markers as well as by colour; the first method is bold."""
    i = summary.methods.index(method)
    if i == 0:
        return {"color": BLUE, "ls": "-", "marker": "o", "lw": 1.8, "ms": 3.5, "zorder": 5}
    colour, marker = _COLOURS[(i - 1) % len(_COLOURS)], _MARKERS[(i - 1) % len(_MARKERS)]
    dashes = _DASHES[(i - 1) // len(_COLOURS) % len(_DASHES)]
    return {"color": colour, "ls": dashes, "marker": marker, "lw": 0.8, "ms": 2.8, "mfc": "white", "mew": 0.7}


def _grid(summary: Summary, note: str, row: float, below: float) -> tuple[Figure, list[Axes]]:
    """A panel a task, three in a row, and room below for what belongs to all."""
    columns = min(3, len(summary.tasks))
    rows = -(-len(summary.tasks) // columns)
    figure = Figure(figsize=(PAGE, (row * rows + below) * MM))
    axes = list(figure.subplots(rows, columns, squeeze=False).ravel())
    for spare in axes[len(summary.tasks) :]:
        spare.set_visible(False)
    for place, task in zip(axes, summary.tasks, strict=False):
        place.set_title(task, loc="left")
    figure.suptitle(note, fontsize=6, color=GREY, x=0.01, ha="left")
    return figure, axes


def _over_time(
    summary: Summary, comparison: Comparison, name: str, factor: float, label: str, highest: float, note: str
) -> Figure:
    figure, axes = _grid(summary, note, 50, 12 + 5.2 * -(-len(summary.methods) // 5))
    for place, task in zip(axes, summary.tasks, strict=False):
        duration = comparison.of(task, 0).task.duration
        time = duration * np.array(summary.checkpoints)
        quartiles = {
            method: factor * summary.over_time(task, method, name)
            for method in summary.methods
            if summary.of_pair(task, method)
        }
        known, upper = (np.concatenate([rows[:, i] for rows in quartiles.values()]) for i in (1, 2))
        known, upper = known[np.isfinite(known)], upper[np.isfinite(upper)]
        if not known.size:
            continue
        least = float(known.min())
        top = min(highest * least, 1.05 * float(upper.max(initial=known.max())))
        for method, rows in quartiles.items():
            there = np.isfinite(rows[:, 1])
            low, middle, high = np.minimum(rows[there], top).T
            # A line without a point that is not clipped would take up room at the figure's corner.
            place.plot(time[there], middle, label=method, clip_on=not there.any(), **_look(summary, method))
            if method == summary.methods[0]:
                place.fill_between(time[there], low, high, color=BLUE, alpha=0.2, lw=0)
            else:
                place.vlines(time[there], low, high, color=_look(summary, method)["color"], lw=0.4)
        place.set(xscale="log", yscale="log", ylim=(0.95 * least, top))
        ticks = (1, 1.5, 2, 3, 5, 7) if top < 10 * least else (1, 3)
        for axis, parts in ((place.xaxis, (1, 2, 5)), (place.yaxis, ticks)):
            _plain_log(axis, parts)
    for place in axes[:: min(3, len(summary.tasks))]:
        place.set_ylabel(label)
    for place in axes[max(len(summary.tasks) - 3, 0) : len(summary.tasks)]:
        place.set_xlabel("the robot's time / s")
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=5, handlelength=3.2)
    return figure


def _plain_log(axis: Axis, parts: tuple[float, ...]) -> None:
    """Numbers without exponents at these parts of each decade."""
    axis.set_major_locator(LogLocator(subs=parts))
    axis.set_minor_locator(NullLocator())
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))


def _methods(summary: Summary, note: str) -> Figure:
    """J of each method at the last checkpoint, as a multiple of the first method's: a row each, a panel a task."""
    figure, axes = _grid(summary, note, 6 + 3.6 * len(summary.methods), 8)
    rows = np.arange(len(summary.methods))[::-1]
    columns = min(3, len(summary.tasks))
    for i, (place, task) in enumerate(zip(axes, summary.tasks, strict=False)):
        place.set_yticks(rows, summary.methods if i % columns == 0 else [""] * len(rows))
        if not summary.of_pair(task, summary.methods[0]):
            continue
        ours = float(np.median(summary.values(task, summary.methods[0], "J")))
        if not np.isfinite(ours):
            continue  # nothing to compare with
        for row, method in zip(rows, summary.methods, strict=True):
            if not summary.of_pair(task, method):
                continue
            low, middle, high = summary.over_time(task, method)[-1] / ours
            look = _look(summary, method)
            if not np.isfinite(middle) or middle > _HIGHEST:
                told = f"{middle:.3g} times" if np.isfinite(middle) else "failed"
                place.annotate(told, (_HIGHEST, row), ha="right", va="center", fontsize=6)
                continue
            place.plot([low, min(high, _HIGHEST)], [row, row], color=look["color"], lw=1.2)
            place.plot(middle, row, look["marker"], color=look["color"], ms=4)
        place.axvline(1.0, color=GREY, lw=0.6, ls=":")
        place.set(xscale="log", xlim=(0.8, _HIGHEST), ylim=(-0.7, len(rows) - 0.3))
        _plain_log(place.xaxis, (1, 1.5, 2, 3))
    figure.supxlabel(
        f"J after {summary.checkpoints[-1]} episodes' worth of time, as a multiple of that of {summary.methods[0]}",
        fontsize=8,
    )
    return figure


def _paths(summary: Summary, comparison: Comparison, factor: float, unit: str, note: str) -> Figure:
    """The true outputs of the first seed's last controllers in their plane, from the least J to the largest."""
    figure, axes = _grid(summary, note, 58, 22)
    shown = _shown(summary)
    for place, task in zip(axes, summary.tasks, strict=False):
        study: Study = comparison.of(task, 0)
        time = study.mpc.sample_time * np.arange(study.task.samples(study.mpc.sample_time) + 1)
        place.plot(
            *(factor * study.task.reference(time)[1:].T), ".", color="#BBBBBB", ms=3, zorder=0, label="reference"
        )
        for method in shown:
            path = next((np.array(cell["path"]) for cell in summary.of_pair(task, method) if cell["path"]), None)
            if path is not None:
                look: dict[str, Any] = _look(summary, method) | {"marker": "", "lw": 1.0}
                place.plot(*(factor * path.T), label=method, **look)
        place.set_aspect("equal", adjustable="datalim")
        place.set(xlabel=f"y / {unit}")
    for place in axes[:: min(3, len(summary.tasks))]:
        place.set_ylabel(f"z / {unit}")
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=4, handlelength=3.2)
    return figure


def _shown(summary: Summary, most: int = 6) -> Sequence[str]:
    """The first method, and others from the best to the worst, in the median of their ranks: what is alike hides."""
    ranks: dict[str, list[float]] = {}
    for task in summary.tasks:
        costs = {m: np.median(summary.values(task, m, "J")) for m in summary.methods if summary.of_pair(task, m)}
        for rank, method in enumerate(sorted(costs, key=lambda m: costs[m])):
            ranks.setdefault(method, []).append(rank)
    others = sorted((m for m in ranks if m != summary.methods[0]), key=lambda m: float(np.median(ranks[m])))
    spread = np.unique(np.linspace(0, len(others) - 1, most - 1).round().astype(int)) if others else ()
    return [summary.methods[0], *(others[i] for i in spread)]


def _elsewhere(summary: Summary, task: str, note: str) -> Figure:
    """J on other robots as a multiple of J on the one that it was tuned for: a row a method, a column a robot."""
    names, told = summary.elsewhere(task)
    methods = list(told)
    shares = np.array([told[m] / np.median(summary.values(task, m, "J")) for m in methods]).reshape(len(methods), -1)
    figure = Figure(figsize=(PAGE, (34 + 5.2 * len(methods)) * MM))
    place = figure.subplots()
    shade = np.log(np.clip(np.where(np.isfinite(shares), shares, 10.0), 1.0, 10.0))
    if shade.size:
        place.imshow(shade, cmap="Blues", vmin=0, vmax=np.log(10), aspect="auto")
    for i, method in enumerate(methods):
        for j in range(len(names)):
            value = told[method][j]
            text = f"{value:.3g}" if np.isfinite(value) else "failed"
            dark = shade[i, j] > 0.55 * np.log(10)
            place.text(j, i, text, ha="center", va="center", fontsize=6, color="white" if dark else BLACK)
    place.set_xticks(range(len(names)), names, rotation=30, ha="right")
    place.set_yticks(range(len(methods)), methods)
    place.tick_params(length=0)
    place.set_title(
        f"{task}: J on robots that it was not tuned on; the darker, the more times J on its own", loc="left"
    )
    for side in place.spines.values():
        side.set_visible(False)
    figure.suptitle(note, fontsize=6, color=GREY, x=0.01, ha="left")
    return figure
