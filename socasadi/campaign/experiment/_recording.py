"""Recordings of experiments that were flown by hand or by another program, as CSV."""

import csv
import re
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ...model import Record
from ...mpc import LinearMPC
from ._episode import Episode
from ._recorded import check_recorded, check_time

if TYPE_CHECKING:
    from .._study import Study


class RecordingError(ValueError):
    """A recording that is not what the study needs; the message says where, and what to do."""


@dataclass(frozen=True)
class Units:
    """What the columns of a recording are in."""

    output: str = "m"
    input: str = "N"

    @classmethod
    def of(cls, plant: object) -> "Units":
        """Those of a plant: what it says, or metres and newtons."""
        return cls(getattr(plant, "output_unit", "m"), getattr(plant, "input_unit", "N"))

    @property
    def shown(self) -> tuple[float, str]:
        """How many of the unit in which outputs are told to people are in one of theirs, and that unit: mm for m."""
        return (1e3, "mm") if self.output == "m" else (1.0, self.output)

    def columns(self, mpc: LinearMPC, *, reference: bool = True) -> dict[str, str]:
        """Names of the columns and their units, in the order in which they are written."""
        kinds = [("y", mpc.outputs, self.output), ("u", mpc.inputs, self.input)]
        kinds += [("r", mpc.outputs, self.output)] * reference + [("w", mpc.measured_disturbances, "")]
        return {"t": "s"} | {f"{kind}{i}": unit for kind, size, unit in kinds for i in range(1, size + 1)}


def resting_input(mpc: LinearMPC) -> np.ndarray:
    """What is held (m,) before an experiment unless it is known: nothing, or as little as the bounds allow."""
    return np.clip(np.zeros(mpc.inputs), *mpc.input_limits)


def read_recording(path: str | Path, study: "Study", *, give_up: float | None = None) -> Episode:
    """The episode in a CSV file, checked against the study it is of.

    Columns, in any order: ``t``, s; ``y1`` ... ``yp``, outputs measured at t; ``u1`` ... ``um``, inputs held from t to
    the next row; ``r1`` ... ``rp``, the reference at t (may be left out, and should not: it shows a wrong unit);
    ``w1`` ... ``wk``, measured disturbances at t when the MPC takes any. Other columns are ignored. The first line
    names the columns, each with or without its unit: ``y1`` or ``y1 [m]``. Row k = 0 ... T of the T samples of the task
    is at t = k ``sample_time``. The last row's inputs are not used and may be empty. One row more may come first, at
    t = -``sample_time``, with the inputs held before and nothing else; without it they are taken to be 0, or the
    closest to it that the bounds allow. Empty lines and lines that start with # are skipped.

    Parameters
    ----------
    give_up
        J from which on a trial is of no interest: a recording that ends early and proves more than this is an episode
        that was ``cut``.

    Raises
    ------
    RecordingError
        Anything is missing, too much or implausible; the line, the column and the value are named.
    """
    sheet, mpc = _Sheet.read(Path(path), study), study.mpc
    episode = Episode(
        sample_time=mpc.sample_time,
        output=(output := sheet.columns("y", mpc.outputs)),
        reference=study.task.reference(mpc.sample_time * np.arange(len(sheet.rows))),
        truth=output,
        tension=sheet.columns("u", mpc.inputs, last=False),
        held=sheet.held,
        shapes=np.zeros((0, 0, 3)),
        disturbance=sheet.columns("w", mpc.measured_disturbances, last=False),
    )
    wanted = sheet.columns("r", mpc.outputs) if "r1" in sheet.found else None
    try:
        bound = check_recorded(episode, study, sheet.time, sheet.lines, wanted, Units.of(study.plant), give_up)
    except ValueError as error:
        raise RecordingError(f"{path}{error}") from None
    return episode if bound is None else Episode(**{**vars(episode), "cut": bound})


def read_probe(path: str | Path, study: "Study") -> Record:
    """The probing record in a CSV file: a short open-loop experiment in which all inputs were moved on their own.

    Columns as in :func:`read_recording`, of any number of samples; a reference is ignored.

    Raises
    ------
    RecordingError
        Anything is missing, too much or implausible; the line, the column and the value are named.
    """
    sheet, mpc = _Sheet.read(Path(path), study), study.mpc
    try:
        check_time(sheet.time, sheet.lines, mpc.sample_time)
    except ValueError as error:
        raise RecordingError(f"{path}{error}") from None
    return Record(mpc.sample_time, sheet.columns("u", mpc.inputs, last=False), sheet.columns("y", mpc.outputs))


def write_recording(episode: Episode, path: str | Path, *, output_unit: str = "m", input_unit: str = "N") -> None:
    """Write ``episode`` as :func:`read_recording` reads it, every number as it is; what it does not hold is lost:
    true outputs, shapes, times.
    """
    k, units = episode.disturbance.shape[1] if len(episode.tension) else 0, Units(output_unit, input_unit)
    named = [("y", episode.output.shape[1], units.output), ("u", episode.tension.shape[1], units.input)]
    named += [("r", episode.reference.shape[1], units.output)]
    heading = ["t [s]", *(f"{kind}{i} [{unit}]" for kind, size, unit in named for i in range(1, size + 1))]
    nothing = {kind: [""] * size for kind, size, _ in named}
    with Path(path).open("w", newline="", encoding="utf-8") as file:
        write = csv.writer(file, lineterminator="\n").writerow
        write([*heading, *(f"w{i}" for i in range(1, k + 1))])
        write([-episode.sample_time, *nothing["y"], *episode.held.tolist(), *nothing["r"], *[""] * k])
        for t, y in enumerate(episode.output):
            last = t == len(episode.tension)
            u = nothing["u"] if last else episode.tension[t].tolist()
            w = [""] * k if last or not k else episode.disturbance[t].tolist()
            write([repr(float(episode.time[t])), *y.tolist(), *u, *episode.reference[t].tolist(), *w])


_Row = tuple[int, list[str]]
"""A line's number and its cells."""


@dataclass(frozen=True, eq=False)
class _Sheet:
    """The rows of samples in a file, where each column stands in them, and what was held before them."""

    path: Path
    rows: list[_Row]
    found: dict[str, int]
    held: np.ndarray

    @classmethod
    def read(cls, path: Path, study: "Study") -> "_Sheet":
        mpc = study.mpc
        headings, rows = _table(path)
        columns = Units.of(study.plant).columns(mpc)
        found = _placed(path, headings, columns, optional={f"r{i}" for i in range(1, mpc.outputs + 1)})
        held, first = resting_input(mpc), rows[0] if rows else None
        if first is not None and _number(path, first, found, "t") < -mpc.sample_time / 2:
            held = np.array([_number(path, first, found, f"u{j}") for j in range(1, mpc.inputs + 1)])
            rows = rows[1:]
        if len(rows) < 2:
            raise RecordingError(f"{path} holds {len(rows)} rows of samples; at least two are needed")
        return cls(path, rows, found, held)

    def columns(self, kind: str, size: int, last: bool = True) -> np.ndarray:
        """Those of one kind (rows, size), with or without the last row."""
        rows = self.rows if last else self.rows[:-1]
        names = [f"{kind}{i}" for i in range(1, size + 1)]
        return np.array([[self._number(row, name) for name in names] for row in rows]).reshape(len(rows), size)

    @property
    def time(self) -> np.ndarray:
        return np.array([self._number(row, "t") for row in self.rows])

    @property
    def lines(self) -> list[int]:
        return [line for line, _ in self.rows]

    def _number(self, row: _Row, name: str) -> float:
        return _number(self.path, row, self.found, name)


_HEADING = re.compile(r"\s*(?P<name>[A-Za-z_]\w*)\s*(?:[\[(]\s*(?P<unit>[^\])]*?)\s*[\])])?\s*")


def _table(path: Path) -> tuple[list[str], list[_Row]]:
    """The headings, and the rows with their line numbers."""
    try:
        text = path.read_text(encoding="utf-8-sig")
    except FileNotFoundError:
        raise RecordingError(f"there is no recording {path}") from None
    except IsADirectoryError:
        raise RecordingError(f"{path} is a directory, not a recording") from None
    except UnicodeDecodeError:
        raise RecordingError(f"{path} is no text in UTF-8: save the recording as CSV") from None
    lines = [(i, line) for i, line in enumerate(text.splitlines(), 1) if line.strip() and not line.startswith("#")]
    if not lines:
        raise RecordingError(f"{path} is empty")
    heading = lines[0][1]
    for sign, name in ((";", "semicolons"), ("\t", "tabs")):
        if sign in heading and "," not in heading:
            raise RecordingError(f"{path} has {name} between its columns: save it with commas, and points in numbers")
    rows = [(number, _cells(path, number, line)) for number, line in lines]
    headings = rows[0][1]
    for number, cells in rows[1:]:
        if any(cells[len(headings) :]):
            raise RecordingError(
                f"{path}, line {number}: {len(cells)} cells under {len(headings)} headings; a number takes a point, "
                "not a comma"
            )
    return headings, rows[1:]


def _cells(path: Path, number: int, line: str) -> list[str]:
    try:
        (row,) = csv.reader([line], strict=True)
    except csv.Error as error:
        raise RecordingError(f"{path}, line {number}: {error}; a row is one line of numbers between commas") from None
    return [cell.strip() for cell in row]


def _placed(path: Path, headings: list[str], columns: dict[str, str], optional: set[str]) -> dict[str, int]:
    """Where each column stands."""
    found: dict[str, int] = {}
    for place, heading in enumerate(headings):
        match = _HEADING.fullmatch(heading)
        name = match["name"].lower() if match else ""
        if name not in columns:
            if re.fullmatch(r"[yurw]\d+", name):
                raise RecordingError(f"{path} has a column {heading!r}, but this study's are {_list(columns)}")
            continue
        if name in found:
            raise RecordingError(f"{path} has two columns {name}")
        unit, needed = (match["unit"] if match else None), columns[name]
        if unit is not None and needed and unit != needed:
            raise RecordingError(f"{path} has {name} in {unit or 'no unit'}, but {needed} is needed")
        found[name] = place
    missing = [name for name in columns if name not in found]
    if missing and set(missing) != optional:
        first = f" (its first line is {','.join(headings)[:80]!r})" if len(missing) == len(columns) else ""
        needed = [name for name in missing if name not in optional] or missing
        raise RecordingError(f"{path} lacks {_list(needed)}{first}; the columns are {_list(columns)}")
    return found


def _list(names: Iterable[str]) -> str:
    return ", ".join(names)


def _number(path: Path, row: _Row, found: dict[str, int], name: str) -> float:
    line, cells = row
    text = cells[found[name]] if found[name] < len(cells) else ""
    try:
        value = float(text)
    except ValueError:
        value = np.nan
    if not np.isfinite(value):
        told = f"is {text!r}, which is no finite number" if text else "is empty"
        raise RecordingError(f"{path}, line {line}: {name} {told}")
    return value
