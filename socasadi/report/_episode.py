import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from ..campaign import Episode
from ._style import (
    BLACK,
    BLUE,
    COLUMN,
    GREY,
    INPUT_COLOURS,
    INPUT_DASHES,
    MM,
    ORANGE,
    legend_above,
    page,
)

Limits = tuple[np.ndarray, np.ndarray]


def responses(episode: Episode, limits: Limits | None) -> Figure:
    """Outputs over time against their references, with the output bounds."""
    outputs = episode.output.shape[1]
    figure, rows = page(COLUMN, (22 + 32 * outputs) * MM, outputs)
    for i, axes in enumerate(rows):
        axes.plot(
            episode.time, 1e3 * episode.reference[:, i], color=BLACK, ls="--", lw=0.9, label="reference", zorder=3
        )
        axes.plot(episode.time, 1e3 * episode.output[:, i], color="#BFBFBF", lw=3, label="measured")
        axes.plot(episode.time, 1e3 * episode.truth[:, i], color=BLUE, lw=1, label="true")
        if limits is not None:
            for side, limit in enumerate(limits):
                axes.axhline(1e3 * limit[i], color=ORANGE, ls=":", lw=1, label=None if side else "bounds")
        axes.set_ylabel(f"{_output_name(i, outputs)} / mm")
        axes.margins(x=0)
    rows[-1].set_xlabel("time / s")
    rows[-1].xaxis.set_major_locator(MaxNLocator(5))
    legend_above(rows[0], 4)
    return figure


def path(episode: Episode) -> Figure:
    """The way of the first two outputs in their plane."""
    figure, (axes,) = page(COLUMN, 88 * MM)
    wanted, truth = 1e3 * episode.reference, 1e3 * episode.truth
    axes.plot(truth[:, 0], truth[:, 1], color=BLUE, label="tip")
    if np.ptp(wanted, axis=0).max() > 0:
        axes.plot(wanted[:, 0], wanted[:, 1], color=BLACK, ls="--", lw=0.9, label="reference")
    else:
        axes.plot(*wanted[0], "+", color=BLACK, ms=9, label="reference")
    axes.plot(*truth[0], "o", color=ORANGE, label="start")
    axes.plot(*truth[-1], "s", mfc="white", mec=ORANGE, label="end")
    axes.set_aspect("equal", adjustable="datalim")
    axes.margins(0.12)
    axes.set_xlabel("y / mm")
    axes.set_ylabel("z / mm")
    legend_above(axes, 4)
    return figure


def inputs(episode: Episode, limits: Limits) -> Figure:
    """Tensions over time with their bounds."""
    figure, (axes,) = page(COLUMN, 58 * MM)
    start = episode.time[:-1]
    k = _apart(episode.tension)
    for j in range(episode.tension.shape[1]):
        colour, dashes = INPUT_COLOURS[j % len(INPUT_COLOURS)], INPUT_DASHES[j % len(INPUT_DASHES)]
        axes.step(start, episode.tension[:, j], where="post", color=colour, ls=dashes, label=f"cable {j + 1}")
        around = {"boxstyle": "circle,pad=0.15", "fc": "white", "ec": colour, "lw": 0.6}
        axes.text(start[k], episode.tension[k, j], str(j + 1), ha="center", va="center", fontsize=6, bbox=around)
    for i, limit in enumerate(sorted({float(value) for side in limits for value in side})):
        axes.axhline(limit, color=GREY, ls=":", lw=1, label=None if i else "bounds")
    axes.set_xlabel("time / s")
    axes.xaxis.set_major_locator(MaxNLocator(5))
    axes.set_ylabel("tension / N")
    axes.set_xlim(0, episode.time[-1])
    legend_above(axes, 4)
    return figure


def shapes(episode: Episode, instants: int = 6) -> Figure | None:
    """The rod in three dimensions at those instants at which its tips lie farthest from each other.

    None when the episode holds no shapes.
    """
    if not len(episode.shapes):
        return None
    # Constrained layout does not know how far the labels of three dimensions reach.
    figure = Figure(figsize=(COLUMN, 92 * MM), layout="none")  # pyright: ignore[reportArgumentType]
    axes = figure.add_subplot(projection="3d")
    chosen = _far_apart(episode.shapes[:, -1], instants)
    for k, index in enumerate(chosen):
        x, y, z = 1e3 * episode.shapes[index].T
        shade = 0.75 * (1 - k / max(len(chosen) - 1, 1))
        colour = (shade, 0.447 * (1 - shade) + shade * 0.85, 0.698 * (1 - shade) + shade * 0.95)
        axes.plot(y, z, x, color=colour, lw=1.6, label=f"{episode.shape_time[index]:.4g} s")
        axes.plot(y[-1:], z[-1:], x[-1:], "o", color=colour, ms=3)
    length = 1e3 * np.abs(episode.shapes).max()
    if episode.reference.shape[1] == 2 and np.ptp(episode.reference, axis=0).max() > 0:
        wanted = 1e3 * episode.reference
        height = 1e3 * float(np.mean(episode.shapes[:, -1, 0]))
        axes.plot(wanted[:, 0], wanted[:, 1], height, color=BLACK, ls="--", lw=0.8, label="reference")
    side = max(1.15e3 * np.abs(episode.shapes[:, :, 1:]).max(), 0.1 * length)
    axes.set(xlim=(-side, side), ylim=(-side, side), zlim=(0, 1.02 * length))
    axes.set_box_aspect((1, 1, 1.5), zoom=0.86)  # pyright: ignore[reportArgumentType]
    axes.set(xlabel="y / mm", ylabel="z / mm", zlabel="x / mm")
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(MaxNLocator(5))
    axes.view_init(elev=18, azim=-55)
    figure.subplots_adjust(left=0.08, right=0.92, bottom=0.04, top=1.0)
    figure.legend(loc="upper left", ncols=1)
    return figure


def _apart(values: np.ndarray) -> int:
    """The row, not close to an end, in which the closest two of the values (k, m) are farthest apart."""
    low, high = len(values) // 10, max(len(values) - len(values) // 10, 1)
    gaps = np.diff(np.sort(values, axis=1), axis=1).min(axis=1, initial=np.inf)
    return low + int(np.argmax(gaps[low:high]))


def _far_apart(points: np.ndarray, count: int) -> list[int]:
    """Up to ``count`` rows that lie far from each other, the first and the last among them, in their order."""
    chosen = [0, len(points) - 1]
    while len(chosen) < min(count, len(points)):
        distance = np.linalg.norm(points[:, None] - points[chosen], axis=2).min(axis=1)
        chosen.append(int(np.argmax(distance)))
    return sorted(set(chosen))


def _output_name(index: int, count: int) -> str:
    return ("y", "z")[index] if count == 2 else f"output {index + 1}"
