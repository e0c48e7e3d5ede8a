"""A run as plain data for its page: numbers as base64 of 16-bit integers with a scale, everything else as JSON."""

import base64
import math
from collections.abc import Iterator
from typing import Any

import casadi as ca
import numpy as np

from ...campaign import Episode, Trial, Units
from ...plant import SimulatedPlant
from ._pieces import Pieces

Data = dict[str, Any]


def page_data(pieces: Pieces, room: int) -> Data:
    """All that the page shows by script; as many episodes as go into ``room`` bytes.

    The best trial's first, then those that were the best so far, then others evenly.
    """
    study = pieces.study
    units = Units.of(study.plant) if study else Units()
    factor, shown = units.shown
    episodes, spent = {}, 0
    for number in _order(pieces):
        episode = pieces.episode(number)
        if episode is None or len(episode.output) < 2:
            continue
        data = _episode(episode)
        if episodes and spent + _size(data) > room:
            break
        episodes[str(number)] = data
        spent += _size(data)
    chosen = pieces.chosen or pieces.best
    points = next((data["shapes"]["shape"][1] for data in episodes.values() if "shapes" in data), 0)
    return {
        "unit": {"factor": factor, "output": shown, "input": units.input},
        "trials": [_trial(trial, pieces.kept(trial)) for trial in pieces.trials],
        "shown": chosen.number if chosen else None,
        "best": pieces.best.number if pieces.best else None,
        "baseline": [trial.J for trial in pieces.baseline],
        "episodes": episodes,
        "reference": _reference(pieces),
        "limits": _limits(pieces),
        "rod": _rod(pieces.rod_plant, study.mpc.input_scale, points) if pieces.rod_plant and study and points else None,
        "slices": _slices(pieces),
    }


def packed(values: np.ndarray) -> Data:
    """An array in 16 bits a number: exact to a part in 65,000 of the largest; the least stands for what is not finite.

    What is more than a thousand times the median is clipped, so that a robot that flew apart is seen until it did.
    """
    values = np.asarray(values, dtype=float)
    size = np.abs(values[np.isfinite(values)])
    largest = min(float(size.max(initial=0.0)), 1e3 * float(np.median(size)) if size.any() else np.inf)
    scale = (largest or float(size.max(initial=0.0))) / 32767 or 1.0
    with np.errstate(invalid="ignore"):
        whole = np.where(np.isfinite(values), np.clip(np.rint(values / scale), -32767, 32767), -32768).astype("<i2")
    return {"shape": values.shape, "scale": scale, "data": base64.b64encode(whole.tobytes()).decode("ascii")}


def _order(pieces: Pieces) -> Iterator[int]:
    trials = [trial for trial in pieces.trials if trial.outcome != "failed" or trial.plant_seconds]
    first = [trial.number for trial in (pieces.chosen, pieces.best) if trial is not None]
    least, better = math.inf, []
    for trial in trials:
        if pieces.kept(trial) and trial.J is not None and least > trial.J:
            least = trial.J
            better.append(trial.number)
    # Bit-reversed, so that any number of them is spread evenly.
    bits = max(len(trials) - 1, 1).bit_length()
    places = sorted(range(len(trials)), key=lambda place: int(f"{place:0{bits}b}"[::-1], 2))
    yield from dict.fromkeys([*first, *reversed(better), *(trials[place].number for place in places)])


def _size(data: Data) -> int:
    return sum(len(value["data"]) + 80 for value in data.values() if isinstance(value, dict))


def _episode(episode: Episode) -> Data:
    data: Data = {
        "dt": episode.sample_time,
        "truth": packed(episode.truth),
        "output": packed(episode.output),
        "input": packed(episode.tension),
    }
    if len(episode.shapes) > 1:
        data |= {"shapes": packed(episode.shapes), "every": float(episode.shape_time[1])}
    return data


def _trial(trial: Trial, kept: bool) -> Data:
    return {
        "n": trial.number,
        "phase": trial.phase,
        "outcome": trial.outcome,
        "J": trial.J,
        "atLeast": trial.at_least,
        "rmse": trial.score.rmse if trial.score else None,
        "kept": kept,
        "failure": trial.failure,
        "theta": trial.theta.tolist(),
    }


def _reference(pieces: Pieces) -> Data | None:
    study = pieces.study
    if study is None:
        return None
    time = study.mpc.sample_time
    return packed(study.task.reference(time * np.arange(study.task.samples(time) + 1)))


def _limits(pieces: Pieces) -> Data:
    mpc = pieces.study and pieces.study.mpc
    if not mpc:
        return {"input": None, "output": None}
    # JSON has no infinity.
    sides = {"input": mpc.input_limits, "output": mpc.output_limits}
    return {
        name: None if pair is None else [[v if math.isfinite(v) else None for v in side.tolist()] for side in pair]
        for name, pair in sides.items()
    }


def _rod(plant: SimulatedPlant, scale: np.ndarray, points: int) -> Data:
    """What a rod's body is drawn from, at the points of the recorded shapes."""
    rod = plant.rod
    places = np.linspace(0.0, rod.length, points)
    edges = np.cumsum([0.0, *(division.length for division in rod.divisions)])
    half = []
    for s in places:
        k = min(int(np.searchsorted(edges, s, side="right")) - 1, len(rod.divisions) - 1)
        division = rod.divisions[k]
        widths = division.section_at(float((s - edges[k]) / division.length)).half_widths
        half.append([float(w) for w in widths] if widths else [0.02 * rod.length] * 2)
    cables = []
    for cable in rod.cables:
        start, end = getattr(cable, "start", 0.0), rod.length if cable.end is None else cable.end
        cables.append(
            [[float(ca.DM(v)) for v in cable.at(float(s))] if start <= s <= end + 1e-9 else None for s in places]
        )
    down = float(np.array(rod.base_rotation)[:, 0] @ np.array(rod.gravity, dtype=float)) > 0
    return {"length": rod.length, "half": half, "cables": cables, "scale": scale.tolist(), "hangs": down}


def _slices(pieces: Pieces) -> list[Data]:
    found, study = pieces.sensitivity, pieces.study
    if found is None or study is None:
        return []
    return [
        {
            "name": entry.name,
            "unit": entry.unit,
            "log": entry.scale == "log",
            "value": float(found.theta[i]),
            "values": found.values[i].tolist(),
            "low": found.low[i].tolist(),
            "middle": found.middle[i].tolist(),
            "high": found.high[i].tolist(),
            "likely": found.likely[i].tolist(),
        }
        for i, entry in enumerate(study.mpc.entries)
    ]
