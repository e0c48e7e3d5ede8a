from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

from ..baselines import Comparison, Size, Summary
from ..campaign import Study, Units
from ._style import BLACK, BLUE, GREY, MM, ORANGE, PAGE, SETTINGS

_COLOURS = (BLUE, ORANGE, "#009E73", "#CC79A7", "#56B4E9", "#E69F00", BLACK)
_DASHES = ("-", (0, (4, 1.5)))
_MARKERS = "osD^vPX*"
_PALE = "#B5B5B5"
_MOST_SHOWN = 8
_AVERAGED = 1.0
"""s over which a distance is the root of its mean square."""
_HIGHEST = 3.0
"""Times the least J, above which there is only a line along the edge."""
_HIGHEST_RMSE = 300.0
"""The same of RMSE, which spreads over decades."""


def comparison_figures(summary: Summary, comparison: Comparison, size: Size) -> dict[str, Figure]:
    """The figures of a comparison by name: cost and rmse over the robot's time, methods, paths, distances, elsewhere.

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
        note += f"\nThe whole comparison: {whole.extent}"
    factor, unit = Units.of(comparison.study.plant).shown
    shown = [name for name in summary.methods if name in (comparison.shown or _spread(summary))]
    with matplotlib.rc_context(SETTINGS):
        short = all(comparison.of(task, comparison.seeds[0]).task.duration <= 5 for task in summary.tasks)
        rmse = "RMSE" if short else "RMSE after 5 s"
        drawn = {
            "cost": _over_time(summary, comparison, shown, "J", 1.0, "J", _HIGHEST, note),
            "rmse": _over_time(summary, comparison, shown, "rmse", factor, f"{rmse} / {unit}", _HIGHEST_RMSE, note),
            "methods": _methods(summary, shown, note),
            "paths": _paths(summary, comparison, shown, factor, unit, note),
            "distances": _distances(summary, comparison, shown, factor, unit, note),
        }
        for task in (task for task in comparison.elsewhere_on if summary.elsewhere(task)[1]):
            drawn[f"elsewhere-{task}" if len(comparison.elsewhere_on) > 1 else "elsewhere"] = _elsewhere(
                summary, task, note
            )
    return drawn


def _look(shown: Sequence[str], method: str) -> dict[str, Any]:
    """Told apart by markers as well as by colour; the first method is bold, and what is not picked out is pale."""
    if method not in shown:
        return {"color": _PALE, "ls": "-", "marker": "", "lw": 0.6, "zorder": 1.5}
    i = shown.index(method)
    look = {"color": _COLOURS[i % len(_COLOURS)], "marker": _MARKERS[i % len(_MARKERS)], "zorder": 3}
    dashes = _DASHES[i // len(_COLOURS) % len(_DASHES)]
    return look | {"ls": dashes, "lw": 1.8 if i == 0 else 0.9, "ms": 3.2, "mfc": look["color"] if i == 0 else "white"}


def _legend(figure: Figure, looks: Mapping[str, Mapping[str, Any]]) -> None:
    """Below all panels, by name."""
    handles = [Line2D([], [], label=name, **look) for name, look in looks.items()]
    figure.legend(handles=handles, loc="outside lower center", ncols=min(5, len(handles)), handlelength=3.2)


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
    summary: Summary,
    comparison: Comparison,
    shown: Sequence[str],
    name: str,
    factor: float,
    label: str,
    highest: float,
    note: str,
) -> Figure:
    figure, axes = _grid(summary, note, 52, 18)
    for place, task in zip(axes, summary.tasks, strict=False):
        duration = comparison.of(task, 0).task.duration
        time = duration * np.array(summary.checkpoints)
        quartiles = {
            method: factor * summary.over_time(task, method, name)
            for method in summary.methods
            if summary.of_pair(task, method)
        }
        lower, known, upper = (np.concatenate([rows[:, i] for rows in quartiles.values()]) for i in range(3))
        lower, known, upper = (values[np.isfinite(values)] for values in (lower, known, upper))
        if not known.size:
            continue
        least = float(lower.min())
        top = min(highest * float(known.min()), 1.05 * float(upper.max(initial=known.max())))
        for method, rows in quartiles.items():
            there = np.isfinite(rows[:, 1])
            low, middle, high = np.minimum(rows[there], top).T
            # Above the scale there is a line along the edge, and no mark.
            look: dict[str, Any] = _look(shown, method) | {"markevery": np.flatnonzero(middle < top).tolist()}
            place.plot(time[there], middle, **look)
            if method == shown[0]:
                place.fill_between(time[there], low, high, color=look["color"], alpha=0.2, lw=0)
            elif method in shown:
                place.vlines(time[there], low, high, color=look["color"], lw=0.4)
        place.set(xscale="log", yscale="log", ylim=(0.95 * least, top))
        _plain_log(place.xaxis, (1, 2, 5))
        _plain_log(place.yaxis, (1, 1.2, 1.5, 2, 2.5, 3, 4, 5, 6, 8) if top < 5 * least else (1, 3))
    _label(axes, summary, "the robot's time / s", label)
    looks = {method: _look(shown, method) for method in shown}
    _legend(figure, looks | ({"others": _look((), "")} if len(shown) < len(summary.methods) else {}))
    return figure


def _label(axes: Sequence[Axes], summary: Summary, below: str, beside: str) -> None:
    """What the axes are: below the lowest panels, beside the first of each row."""
    for place in axes[:: min(3, len(summary.tasks))]:
        place.set_ylabel(beside)
    for place in axes[max(len(summary.tasks) - 3, 0) : len(summary.tasks)]:
        place.set_xlabel(below)


def _plain_log(axis: Axis, parts: tuple[float, ...]) -> None:
    """Numbers without exponents at these parts of each decade."""
    axis.set_major_locator(LogLocator(subs=parts))
    axis.set_minor_locator(NullLocator())
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))


def _methods(summary: Summary, shown: Sequence[str], note: str) -> Figure:
    """J of each method at the last checkpoint, as a multiple of the first method's: a row each, a panel a task."""
    figure, axes = _grid(summary, note, max(6 + 3.6 * len(summary.methods), 30), 8)
    rows = np.arange(len(summary.methods))[::-1]
    columns = min(3, len(summary.tasks))
    for i, (place, task) in enumerate(zip(axes, summary.tasks, strict=False)):
        place.set_yticks(rows, summary.methods if i % columns == 0 else [""] * len(rows))
        if not summary.of_pair(task, summary.methods[0]):
            continue
        ours = float(np.median(summary.values(task, summary.methods[0], "J")))
        if not np.isfinite(ours):
            continue  # nothing to compare with
        least = 1.0
        for row, method in zip(rows, summary.methods, strict=True):
            if not summary.of_pair(task, method):
                continue
            low, middle, high = summary.over_time(task, method)[-1] / ours
            colour, marker = (_look(shown, method)[part] for part in ("color", "marker"))
            colour = colour if method in shown else GREY
            if not np.isfinite(middle) or middle > _HIGHEST:
                told = f"{middle:.3g} times" if np.isfinite(middle) else "failed"
                place.annotate(told, (_HIGHEST, row), ha="right", va="center", fontsize=6)
                continue
            least = min(least, low)
            place.plot([low, min(high, _HIGHEST)], [row, row], color=colour, lw=1.2)
            place.plot(middle, row, marker or ".", color=colour, ms=4 if marker else 6)
        place.axvline(1.0, color=GREY, lw=0.6, ls=":")
        place.set(xscale="log", xlim=(min(0.8, 0.95 * least), _HIGHEST), ylim=(-0.7, len(rows) - 0.3))
        _plain_log(place.xaxis, (1, 1.5, 2, 3))
    figure.supxlabel(
        f"J after {summary.checkpoints[-1]} episodes' worth of time, as a multiple of that of {summary.methods[0]}",
        fontsize=8,
    )
    return figure


def _paths(
    summary: Summary, comparison: Comparison, shown: Sequence[str], factor: float, unit: str, note: str
) -> Figure:
    """The true outputs of the first seed's last controllers in their plane."""
    figure, axes = _grid(summary, note, 58, 18)
    looks: dict[str, dict[str, Any]] = {method: _look(shown, method) | {"marker": "", "lw": 0.9} for method in shown}
    reference: dict[str, Any] = {"color": "#BBBBBB", "ls": "", "marker": ".", "ms": 3, "zorder": 0}
    for place, task in zip(axes, summary.tasks, strict=False):
        place.plot(*(factor * _wanted(comparison.of(task, 0))[1:].T), **reference)
        for method, path in _flown(summary, task, shown):
            place.plot(*(factor * path.T), **looks[method])
        place.set_aspect("equal", adjustable="datalim")
    _label(axes, summary, f"y / {unit}", f"z / {unit}")
    _legend(figure, looks | {"reference": reference})
    return figure


def _distances(
    summary: Summary, comparison: Comparison, shown: Sequence[str], factor: float, unit: str, note: str
) -> Figure:
    """How far those paths are from their references, over time: what lies one on another in the plane is apart here."""
    figure, axes = _grid(summary, note, 52, 18)
    looks: dict[str, dict[str, Any]] = {method: _look(shown, method) | {"marker": "", "lw": 0.9} for method in shown}
    for place, task in zip(axes, summary.tasks, strict=False):
        study, largest = comparison.of(task, 0), 0.0
        wanted = _wanted(study)
        for method, path in _flown(summary, task, shown):
            square = np.sum((factor * (path - wanted[: len(path)])) ** 2, axis=1)
            window = np.ones(min(max(round(_AVERAGED / study.mpc.sample_time), 1), len(path)))
            count = np.convolve(np.ones(len(path)), window, "same")
            distance = np.sqrt(np.convolve(square, window, "same") / count)
            largest = max(largest, float(np.nanmax(distance, initial=0.0)))
            place.plot(study.mpc.sample_time * np.arange(len(path)), distance, **looks[method])
        if largest > 0:
            place.set(yscale="log", ylim=(3e-4 * largest, 1.5 * largest))
            _plain_log(place.yaxis, (1,))
    _label(axes, summary, "time / s", f"distance / {unit}")
    _legend(figure, looks)
    return figure


def _wanted(study: Study) -> np.ndarray:
    """The reference (T + 1, p) at all samples of the task."""
    time = study.mpc.sample_time * np.arange(study.task.samples(study.mpc.sample_time) + 1)
    return study.task.reference(time)


def _flown(summary: Summary, task: str, shown: Sequence[str]) -> Iterator[tuple[str, np.ndarray]]:
    """The last one first, so that the first one is drawn over it."""
    for method in reversed(shown):
        path = next(
            (np.array(cell["path"], dtype=float) for cell in summary.of_pair(task, method) if cell["path"]), None
        )
        if path is not None:
            yield method, path


def _spread(summary: Summary) -> Sequence[str]:
    """The first method, and others from the best to the worst, in the median of their ranks."""
    ranks: dict[str, list[float]] = {}
    for task in summary.tasks:
        costs = {m: np.median(summary.values(task, m, "J")) for m in summary.methods if summary.of_pair(task, m)}
        for rank, method in enumerate(sorted(costs, key=lambda m: costs[m])):
            ranks.setdefault(method, []).append(rank)
    others = sorted((m for m in ranks if m != summary.methods[0]), key=lambda m: float(np.median(ranks[m])))
    spread = np.unique(np.linspace(0, len(others) - 1, _MOST_SHOWN - 1).round().astype(int)) if others else ()
    return [summary.methods[0], *(others[i] for i in spread)]


def _elsewhere(summary: Summary, task: str, note: str) -> Figure:
    """J on other robots, shaded by how many times that on the one that it was tuned for: a row a method."""
    names, told = summary.elsewhere(task)
    methods = list(told)
    own = np.array([np.median(summary.values(task, m, "J")) for m in methods])
    costs = np.array([[J, *told[m]] for J, m in zip(own, methods, strict=True)]).reshape(len(methods), -1)
    with np.errstate(invalid="ignore"):  # where it failed on its own robot
        shares = costs / own[:, None]
    figure = Figure(figsize=(PAGE, (34 + 5.2 * len(methods)) * MM))
    place = figure.subplots()
    shade = np.log10(np.clip(np.where(np.isfinite(shares), shares, 10.0), 1.0, 10.0))
    if shade.size:
        image = place.imshow(shade, cmap="Blues", vmin=0, vmax=1, aspect="auto")
        bar = figure.colorbar(image, ax=place, pad=0.01, aspect=40, label="as a multiple of J on its own robot")
        bar.set_ticks(np.log10([1, 2, 3, 5, 10]).tolist(), labels=["1", "2", "3", "5", "10 or more"])
        bar.outline.set_visible(False)  # pyright: ignore[reportCallIssue]
    for i in range(len(methods)):
        for j, value in enumerate(costs[i]):
            text = f"{value:.3g}" if np.isfinite(value) else "failed"
            dark = shade[i, j] > 0.55
            place.text(j, i, text, ha="center", va="center", fontsize=6, color="white" if dark else BLACK)
    place.set_xticks(range(costs.shape[1]), ["its own", *names], rotation=30, ha="right")
    place.set_yticks(range(len(methods)), methods)
    place.tick_params(length=0)
    place.set_title(f"{task}: J on the robot that it was tuned for, and on others", loc="left")
    for side in place.spines.values():
        side.set_visible(False)
    figure.suptitle(note, fontsize=6, color=GREY, x=0.01, ha="left")
    return figure
