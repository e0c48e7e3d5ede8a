"""Whether a recording can be of the study that it is told to; each fault is a sentence about a line and a value."""

from typing import TYPE_CHECKING

import numpy as np

from ._episode import Episode

if TYPE_CHECKING:
    from .._study import Study
    from ._recording import Units

_JITTER = 0.25
"""Share of a sample by which two rows may be closer or farther apart."""
_DRIFT = 0.01
"""Share of the time by which the clock may be wrong."""
_REFERENCE = 0.01
"""Share of the largest reference by which a recorded one may differ: a few digits are enough."""
_BEYOND = 1e-3
"""Share of the largest input by which one may be beyond its bounds: rounding."""
_IMPLAUSIBLE = 30.0
"""How many times the largest of references and bounds are taken for another unit."""


def check_recorded(
    episode: Episode,
    study: "Study",
    time: np.ndarray,
    lines: list[int],
    wanted: np.ndarray | None,
    units: "Units",
    give_up: float | None,
) -> float | None:
    """ValueError for what cannot be; the lower bound of J that a recording cut early proves, None of a whole one.

    Parameters
    ----------
    time, lines
        (T + 1,) s, and the lines of the file on which the rows stand.
    wanted
        (T + 1, p) recorded references, if there are any.
    give_up
        What the lower bound has to be above.
    """
    check_time(time, lines, episode.sample_time)
    samples, recorded = study.task.samples(episode.sample_time), len(episode.tension)
    whole, missing = samples * episode.sample_time, samples - recorded
    if missing < 0:
        raise ValueError(
            f", line {lines[samples + 1]}: the task of {whole:g} s has {samples + 1} rows, this recording "
            f"{len(lines)}; remove what comes after the task's end"
        )
    _check_sizes(episode, study, time, lines, wanted, units)
    if not missing:
        return None
    proven = float(study.cost.running(episode, study.mpc.input_scale)[-1])
    if give_up is not None and proven > give_up:
        return proven
    hopeless = f" (so far its J is {proven:.4g}; above {give_up:.4g} it could be)" if give_up is not None else ""
    rows = "1 row is" if missing == 1 else f"{missing} rows are"
    raise ValueError(
        f" ends at t = {time[-1]:g} s, but the task takes {whole:g} s: {rows} missing{hopeless}; fly the whole task, "
        "or tell that the trial failed"
    )


def check_time(time: np.ndarray, lines: list[int], sample_time: float) -> None:
    """ValueError unless rows (k,) s on those lines of a file are one sample apart, from 0 on."""
    steps, apart = np.diff(time), float(np.median(np.diff(time)))
    if not abs(apart / sample_time - 1) < _JITTER:
        unit = "; is t in ms?" if abs(apart / (1e3 * sample_time) - 1) < _JITTER else ""
        raise ValueError(f" has a row every {apart:g} s, but the sample time is {sample_time:g} s{unit}")
    if abs(time[0]) > _JITTER * sample_time:
        raise ValueError(f", line {lines[0]}: the first sample is at t = {time[0]:g} s, and 0 is needed")
    wrong = np.flatnonzero(np.abs(steps - sample_time) > _JITTER * sample_time)
    if len(wrong):
        k = int(wrong[0])
        missing = round(steps[k] / sample_time) - 1
        told = f"{missing} sample{'s' * (missing > 1)} missing" if missing > 0 else "rows are not one sample apart"
        raise ValueError(
            f", line {lines[k + 1]}: t = {time[k + 1]:g} s follows {time[k]:g} s with a sample time of "
            f"{sample_time:g} s: {told}"
        )
    end = sample_time * len(steps)
    if abs(time[-1] - end) > max(sample_time, _DRIFT * end):
        raise ValueError(
            f", line {lines[-1]}: t = {time[-1]:g} s, but {len(steps)} samples of {sample_time:g} s end at {end:g} s: "
            "the clocks do not agree"
        )


def _check_sizes(
    episode: Episode, study: "Study", time: np.ndarray, lines: list[int], wanted: np.ndarray | None, units: "Units"
) -> None:
    mpc = study.mpc
    largest = float(np.abs(episode.reference).max())
    bound = mpc.largest_output_bound
    size = max(largest, np.abs(study.task.start or 0.0).max(), bound if np.isfinite(bound) else 0.0)

    def place(k: int, column: str, value: float, unit: str) -> str:
        return f", line {lines[k]} (t = {time[k]:g} s): {column} is {value:.6g} {unit}".rstrip()

    if wanted is not None:
        tolerance = _REFERENCE * (largest or size)
        k, i = np.unravel_index(np.argmax(np.abs(wanted - episode.reference) > tolerance), wanted.shape)
        if abs(wanted[k, i] - episode.reference[k, i]) > tolerance:
            meant = episode.reference[k, i]
            hint = f": is it in {units.output}?" if meant and not 0.1 < abs(wanted[k, i] / meant) < 10 else ""
            told = place(int(k), f"r{i + 1}", wanted[k, i], units.output)
            raise ValueError(f"{told}, but the task wants {meant:.6g}{hint}")
    k, i = np.unravel_index(np.argmax(np.abs(episode.output)), episode.output.shape)
    if size and abs(episode.output[k, i]) > _IMPLAUSIBLE * size:
        told = place(int(k), f"y{i + 1}", episode.output[k, i], units.output)
        times = abs(episode.output[k, i]) / size
        raise ValueError(f"{told}, {times:.0f} times the largest reference or bound: is it in {units.output}?")
    lower, upper = mpc.input_limits
    beyond = np.maximum(episode.tension - upper, lower - episode.tension) > _BEYOND * mpc.input_scale
    if beyond.any():
        k, j = np.unravel_index(np.argmax(beyond), beyond.shape)
        times = float((np.abs(episode.tension) / mpc.input_scale).max())
        hint = ": is it in mN?" if units.input == "N" and _IMPLAUSIBLE < times <= 1e3 else ""
        raise ValueError(
            f"{place(int(k), f'u{j + 1}', episode.tension[k, j], units.input)}, beyond its bounds {lower[j]:g} and "
            f"{upper[j]:g} {units.input}{hint}"
        )
