import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, MaxNLocator, NullFormatter

from ..campaign import Trial
from ._style import BLACK, BLUE, COLUMN, MM, ORANGE, legend_above, page

# Costs above this multiple of the best are not resolved.
_HIGHEST = 30


def convergence(trials: list[Trial], baseline: list[Trial] | None = None) -> Figure:
    """Cost of each trial and the best so far; the baseline's best so far beside it."""
    figure, (axes,) = page(COLUMN, 62 * MM)
    axes.set_yscale("log")
    known = [trial.J for trial in trials if trial.J is not None]
    ceiling = _HIGHEST * min(known, default=1.0)
    for phase, label, marker, face in (("seed", "seed point", "s", "white"), ("search", "search", "o", BLUE)):
        done = [(t.number, t.J) for t in trials if t.phase == phase and t.J is not None and ceiling >= t.J]
        if done:
            style = {"mfc": face, "mec": BLUE, "mew": 0.6, "ms": 2.8, "zorder": 2}
            axes.plot(*np.transpose(done), marker, label=label, **style)
    # Failures have no cost, and what is far off would squeeze the rest: both stand on the upper edge.
    beyond = [t.number for t in trials if t.J is not None and ceiling < t.J]
    failed = [t.number for t in trials if t.J is None]
    for numbers, label, marker, colour in ((beyond, "off the scale", "^", BLUE), (failed, "failed", "x", ORANGE)):
        if numbers:
            edge = {"transform": axes.get_xaxis_transform(), "clip_on": False, "ls": "", "mew": 0.6}
            axes.plot(numbers, np.ones(len(numbers)), marker=marker, mfc="white", mec=colour, label=label, **edge)
    incumbent = best_so_far(trials)
    axes.step(np.arange(1, len(trials) + 1), incumbent, where="post", color=BLACK, label="best so far", zorder=4)
    if baseline:
        steps = np.arange(1, len(baseline) + 1)
        axes.step(
            steps, best_so_far(baseline), where="post", color=ORANGE, ls="--", label="best of Sobol points", zorder=3
        )
    if np.isfinite(incumbent).any():
        best = int(np.nanargmin(incumbent))
        axes.plot(best + 1, incumbent[best], "*", color=ORANGE, ms=9, mec="white", mew=0.5, zorder=5)
        # Above and to the left, where the trials before were worse.
        right = best > len(trials) / 2
        axes.annotate(
            f"{incumbent[best]:.3g}",
            (best + 1, incumbent[best]),
            xytext=(-4 if right else 4, -11),
            textcoords="offset points",
            ha="right" if right else "left",
            color=ORANGE,
        )
    axes.yaxis.set_major_locator(LogLocator(numticks=8))
    axes.yaxis.set_minor_formatter(NullFormatter())
    if known:
        axes.set_ylim(min(known) / 1.5, min(1.3 * max(known), ceiling))
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    axes.set_xlim(0, max(len(trials), len(baseline or [])) + 2)
    axes.set_xlabel("trial")
    axes.set_ylabel("cost J")
    legend_above(axes, 3)
    return figure


def best_so_far(trials: list[Trial]) -> np.ndarray:
    """Least cost up to each trial; NaN while all have failed."""
    costs = np.array([np.inf if trial.J is None else trial.J for trial in trials])
    least = np.minimum.accumulate(costs) if len(costs) else costs
    return np.where(np.isfinite(least), least, np.nan)
