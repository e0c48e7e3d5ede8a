from collections.abc import Callable

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullLocator

from ..campaign import Trial
from ._style import BLACK, BLUE, COLUMN, GREY, MM, ORANGE, legend_above, page

# Costs above this multiple of the best are not resolved.
_HIGHEST = 30

# Of the many points, on which lines, the star and its number can be read, in grey, too.
_PALE = "#9CCBE6"


def convergence(trials: list[Trial], kept: Callable[[Trial], bool], baseline: list[Trial] | None = None) -> Figure:
    """Cost of each trial and the best so far of those that are ``kept``; the baseline's best so far beside it.

    Trials stand in the order in which they were told.
    """
    figure, (axes,) = page(COLUMN, 62 * MM)
    cost_axis(axes)
    known = [trial.J for trial in trials if trial.J is not None]
    ceiling = _HIGHEST * min(known, default=1.0)
    told = [(place, trial, trial.at_least if trial.J is None else trial.J) for place, trial in enumerate(trials, 1)]
    kinds = {
        "seed point": ("s", "white", BLUE, [(n, J) for n, t, J in told if kept(t) and t.phase == "seed"]),
        "search": ("o", _PALE, _PALE, [(n, J) for n, t, J in told if kept(t) and t.phase == "search"]),
        "broke a limit": ("D", "white", ORANGE, [(n, J) for n, t, J in told if t.J is not None and not kept(t)]),
        "cut: J is above": ("^", "white", GREY, [(n, J) for n, t, J in told if t.at_least is not None]),
    }
    for label, (marker, face, edge, points) in kinds.items():
        seen = [(n, J) for n, J in points if J is not None and ceiling >= J]
        if seen:
            axes.plot(*np.transpose(seen), marker, label=label, mfc=face, mec=edge, mew=0.6, ms=2.8, zorder=2)
    # Failures have no cost, and what is far off would squeeze the rest: both stand on the upper edge.
    beyond = [n for n, _, J in told if J is not None and ceiling < J]
    failed = [n for n, _, J in told if J is None]
    for numbers, label, marker, colour in ((beyond, "off the scale", "2", BLUE), (failed, "failed", "x", ORANGE)):
        if numbers:
            edge = {"transform": axes.get_xaxis_transform(), "clip_on": False, "ls": "", "mew": 0.6}
            axes.plot(numbers, np.ones(len(numbers)), marker=marker, mfc="white", mec=colour, label=label, **edge)
    incumbent = best_so_far(trials, kept)
    axes.step(np.arange(1, len(trials) + 1), incumbent, where="post", color=BLACK, label="best so far", zorder=4)
    if baseline:
        steps = np.arange(1, len(baseline) + 1)
        axes.step(
            steps,
            best_so_far(baseline, kept),
            where="post",
            color=ORANGE,
            ls="--",
            lw=1.3,
            label="best of Sobol points",
            zorder=3,
        )
    if np.isfinite(incumbent).any():
        best = int(np.nanargmin(incumbent))
        axes.plot(best + 1, incumbent[best], "*", color=ORANGE, ms=10, mec=BLACK, mew=0.7, zorder=5)
        # Below, where no trial is.
        right = best > len(trials) / 2
        axes.annotate(
            f"{incumbent[best]:.3g}, trial {trials[best].number}",
            (best + 1, incumbent[best]),
            xytext=(5 if right else -5, -15),
            textcoords="offset points",
            ha="right" if right else "left",
        )
    if known:
        highest = max(J for _, _, J in told if J is not None and ceiling >= J)
        axes.set_ylim(min(known) / 2, min(1.3 * highest, ceiling))
    axes.set_xlim(0, max(len(trials), len(baseline or [])) + 2)
    legend_above(axes, 3)
    return figure


def cost_axis(axes: Axes) -> None:
    """Costs of trials: J, which spans decades, on a logarithmic axis with numbers that can be read off."""
    axes.set_yscale("log")
    axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0), numticks=12))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda J, _: f"{J:g}"))
    axes.yaxis.set_minor_locator(NullLocator())
    axes.xaxis.set_major_locator(MaxNLocator(integer=True, steps=[1, 2, 5, 10]))
    axes.set_xlabel("trial")
    axes.set_ylabel("cost J")


def best_so_far(trials: list[Trial], kept: Callable[[Trial], bool]) -> np.ndarray:
    """Least cost of those kept up to each trial; NaN before the first."""
    costs = np.array([trial.J if kept(trial) else np.inf for trial in trials])
    least = np.minimum.accumulate(costs) if len(costs) else costs
    return np.where(np.isfinite(least), least, np.nan)
