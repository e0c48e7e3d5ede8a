from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from ..campaign import Episode, Result, Units
from ._film import RATES, film_writer
from ._style import BLACK, BLUE, GREY, INPUT_COLOURS, INPUT_DASHES, SETTINGS

# What moves in a panel, brought to an instant in s.
Moving = Callable[[float], list[Artist]]

# 1280 by 720 pixels, with type for the last row of a lecture hall.
_SIZE, _DPI = (12.8, 7.2), 100
_SLIDE: dict[Any, Any] = SETTINGS | {
    "font.size": 15,
    "axes.labelsize": 15,
    "xtick.labelsize": 13,
    "ytick.labelsize": 13,
    "legend.fontsize": 14,
    "axes.linewidth": 1.0,
    "lines.linewidth": 2.5,
    "lines.markersize": 10,
    "figure.constrained_layout.use": False,
}
_MOVING: dict[str, Any] = {"animated": True}


def animate(
    result: Result,
    file: str | Path,
    trial: int | None = None,
    *,
    progress: Callable[[int, int], None] | None = None,
) -> Path:
    """Write an animation of one episode in real time: the rod, the path in the plane of the outputs, the tensions.

    The rod moves linearly between the shapes that the episode holds; where it holds none, the rod is left out.

    Parameters
    ----------
    file
        Ends in .gif (10 frames a second), or in .mp4 (25), which needs ffmpeg. When this fails or is interrupted, what
        was there before is kept.
    trial
        Number of the trial; the best one by default.
    progress
        Called after each frame with how many are drawn, and of how many.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    ValueError
        The suffix is another, there is no ffmpeg, the robot has not two outputs, or the episode ended before its first
        sample did.
    RunError
        There is no such trial, or it has no record.
    """
    file = Path(file)
    write = film_writer(file)
    rate = RATES[file.suffix.lower()]
    number = result.best.number if trial is None else trial
    episode = result.episode(number)
    if (outputs := result.study.mpc.outputs) != 2:
        raise ValueError(f"an animation draws the path of two outputs, and this robot has {outputs}: take the figures")
    if len(episode.output) < 2:
        raise ValueError(f"trial {number} ended before its first sample did: animate another")
    end = episode.time[-1]
    times = np.minimum(np.arange(np.ceil(end * rate - 1e-6) + 1) / rate, end)
    (told,) = (trial for trial in result.trials if trial.number == number)
    title = f"trial {number}, {told.outcome if told.J is None else f'J = {told.J:.4g}'}"

    def frames() -> Iterator[np.ndarray]:
        for done, frame in enumerate(_frames(result, episode, title, times), 1):
            yield frame
            if progress is not None:
                progress(done, len(times))

    with matplotlib.rc_context(_SLIDE):
        write(frames(), rate)
    return file


def _frames(result: Result, episode: Episode, title: str, times: np.ndarray) -> Iterator[np.ndarray]:
    """Pixels (720, 1280, 4) of the episode at ``times``, each valid until the next.

    What stands still is drawn once, and each frame begins with a copy of it.
    """
    figure = Figure(figsize=_SIZE, dpi=_DPI)
    canvas = FigureCanvasAgg(figure)
    units = Units.of(result.study.plant)
    figure.text(0.025, 0.945, title, fontsize=19)
    clock = figure.text(0.975, 0.945, "", fontsize=19, ha="right", **_MOVING)
    if len(episode.shapes):
        rod = figure.add_axes((0.0, 0.08, 0.46, 0.85), projection="3d")
        moving = [_rod(rod, episode)]
        plane, below = figure.add_axes((0.545, 0.42, 0.27, 0.48)), figure.add_axes((0.545, 0.11, 0.43, 0.18))
    else:
        moving = []
        plane, below = figure.add_axes((0.09, 0.12, 0.38, 0.72)), figure.add_axes((0.575, 0.12, 0.40, 0.42))
    moving += [_path(plane, episode, units), _inputs(below, episode, result.study.mpc.input_limits, units)]
    canvas.draw()
    still = canvas.copy_from_bbox(figure.bbox)
    for time in times:
        canvas.restore_region(still)
        clock.set_text(f"{time:.1f} s")
        for artist in [clock, *(artist for bring in moving for artist in bring(time))]:
            figure.draw_artist(artist)
        yield np.asarray(canvas.buffer_rgba())


def _rod(axes, episode: Episode) -> Moving:
    """The rod in three dimensions, its tip's way and, where the outputs are the tip's, the reference."""
    shapes, times = 1e3 * episode.shapes[..., [1, 2, 0]], episode.shape_time
    tips, wanted = shapes[:, -1], 1e3 * episode.reference
    length = float(np.linalg.norm(np.diff(shapes[0], axis=0), axis=1).sum())
    seen = 1e3 * episode.truth[np.searchsorted(episode.time, times - 1e-9)]
    extent = shapes
    if np.abs(seen - tips[:, :2]).max() < 0.01 * length:  # not a laser's spot on a screen
        height = np.full(len(wanted), tips[:, 2].mean())
        axes.plot(*wanted.T, height, color=BLACK, ls="--", lw=1.8)
        extent = np.concatenate([shapes.reshape(-1, 3), np.column_stack([wanted, height])])
    side = max(1.1 * np.abs(extent[..., :2]).max(), 0.2 * length)
    low, high = min(float(shapes[..., 2].min()), 0.0), max(float(shapes[..., 2].max()), 0.5 * length)
    axes.set(xlim=(-side, side), ylim=(-side, side), zlim=(low, high))
    axes.set_box_aspect((2 * side, 2 * side, high - low), zoom=0.92)
    axes.view_init(elev=18, azim=-55)
    # Ticks that stay away from the corner, where those of y and z would meet.
    decade = 10 ** np.floor(np.log10(0.75 * side))
    tick = max(step * decade for step in (1, 2, 5) if step * decade <= 0.75 * side)
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_ticks([-tick, tick])
    axes.zaxis.set_major_locator(MaxNLocator(4, steps=[1, 2, 5, 10]))
    axes.zaxis.set_tick_params(pad=9)
    for axis, name, pad in ((axes.xaxis, "y", 8), (axes.yaxis, "z", 8), (axes.zaxis, "x", 18)):
        axis.set_pane_color((1, 1, 1))
        axis.set_label_text(f"{name} / mm")
        axis.labelpad = pad
    (way,) = axes.plot([], [], [], color=BLUE, **_MOVING)
    (rod,) = axes.plot([], [], [], color=GREY, lw=8, solid_capstyle="round", **_MOVING)
    (tip,) = axes.plot([], [], [], "o", color=BLUE, **_MOVING)

    def bring(time: float) -> list[Artist]:
        trace = _until(time, times, tips)
        way.set_data_3d(*trace.T)
        rod.set_data_3d(*_between(time, times, shapes).T)
        tip.set_data_3d(*trace[-1:].T)
        return [way, rod, tip]

    return bring


def _path(axes: Axes, episode: Episode, units: Units) -> Moving:
    """The way of the outputs in their plane, with the reference."""
    factor, unit = units.shown
    wanted, truth = factor * episode.reference, factor * episode.truth
    axes.plot(*wanted.T, color=BLACK, ls="--", lw=1.8, label="reference")
    (way,) = axes.plot([], [], color=BLUE, label="tip", **_MOVING)
    (now,) = axes.plot([], [], "o", color=BLACK, mfc="white", mew=2, label="reference now", **_MOVING)
    (tip,) = axes.plot([], [], "o", color=BLUE, **_MOVING)
    everything = np.concatenate([wanted, truth])
    low, high = everything.min(axis=0), everything.max(axis=0)
    side = 0.56 * max((high - low).max(), 1e-9)
    centre = (low + high) / 2
    axes.set(xlim=(centre[0] - side, centre[0] + side), ylim=(centre[1] - side, centre[1] + side))
    axes.set_aspect("equal")
    axes.set(xlabel=f"y / {unit}", ylabel=f"z / {unit}")
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(MaxNLocator(5, steps=[1, 2, 5, 10]))
    axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), handlelength=1.6)

    def bring(time: float) -> list[Artist]:
        trace = _until(time, episode.time, truth)
        way.set_data(*trace.T)
        tip.set_data(*trace[-1:].T)
        now.set_data(*_between(time, episode.time, wanted)[:, None])
        return [way, now, tip]

    return bring


def _inputs(axes: Axes, episode: Episode, limits: tuple[np.ndarray, np.ndarray], units: Units) -> Moving:
    """The tensions so far with their bounds."""
    name, each = ("tension", "cable") if units.input == "N" else ("input", "input")
    bounds = sorted({float(value) for side in limits for value in side if np.isfinite(value)})
    for limit in bounds:
        axes.axhline(limit, color=GREY, ls=":", lw=1.8)
    lines = []
    for j in range(episode.tension.shape[1]):
        colour, dashes = INPUT_COLOURS[j % len(INPUT_COLOURS)], INPUT_DASHES[j % len(INPUT_DASHES)]
        style = {"color": colour, "ls": dashes, "lw": 2, "drawstyle": "steps-post", **_MOVING}
        lines += axes.plot([], [], label=f"{j + 1}" if j else f"{each} 1", **style)
    extremes = [*bounds, float(episode.tension.min()), float(episode.tension.max())]
    margin = 0.08 * max(max(extremes) - min(extremes), 1e-9)
    axes.set(xlim=(0, episode.time[-1]), ylim=(min(extremes) - margin, max(extremes) + margin))
    axes.set(xlabel="time / s", ylabel=f"{name} / {units.input}")
    for axis, count in ((axes.xaxis, 5), (axes.yaxis, 3)):
        axis.set_major_locator(MaxNLocator(count, steps=[1, 2, 5, 10]))
    axes.legend(loc="lower right", bbox_to_anchor=(1.02, 0.96), ncols=len(lines), handlelength=1.8, columnspacing=1.2)

    def bring(time: float) -> list[Artist]:
        begun = max(int(np.searchsorted(episode.time[:-1], time + 1e-9)), 1)
        start = np.append(episode.time[:begun], time)
        for line, tension in zip(lines, episode.tension[:begun].T, strict=True):
            line.set_data(start, np.append(tension, tension[-1]))
        return lines

    return bring


def _between(time: float, times: np.ndarray, values: np.ndarray) -> np.ndarray:
    """``values`` (n, ...) of ``times`` (n,) at ``time``, linear between two; the last beyond the last."""
    after = min(int(np.searchsorted(times, time, side="right")), len(times) - 1)
    before = max(after - 1, 0)
    share = min((time - times[before]) / (times[after] - times[before]), 1.0) if after else 0.0
    return values[before] + share * (values[after] - values[before])


def _until(time: float, times: np.ndarray, values: np.ndarray) -> np.ndarray:
    """The rows of ``values`` (n, k) at ``times`` up to ``time``, and the one at ``time``."""
    return np.vstack([values[times <= time], _between(time, times, values)])
