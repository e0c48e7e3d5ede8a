"""The journal's tables, and its objects as their rows: numbers and texts, NULL for what is not known."""

import json
import zlib
from dataclasses import asdict
from typing import Any

import numpy as np

from ..experiment import Episode, Score
from ._pack import pack, unpack
from ._trial import Asked, Flight, Trial

SCHEMA = 3

_TRIAL = """
    phase TEXT NOT NULL,         -- 'seed' or 'search'
    theta TEXT NOT NULL,         -- JSON list, in the order of the prediction model's entries
    by_hand INTEGER NOT NULL,    -- 1: asked for somebody who flies and tells it, so that a run does not fly it
    asked INTEGER NOT NULL,      -- event: asks, tells and takings back are counted together, from 1, as they happened
    told INTEGER,                -- event; NULL while nothing was told
    outcome TEXT,                -- 'done', 'failed' or 'cut'; NULL while nothing was told
    J REAL,                      -- cost of a trial that is done
    at_least REAL,               -- what J of a cut trial would have been at least
    score TEXT,                  -- JSON object: J, its parts, the literal J, RMSE in m
    measured TEXT,               -- JSON object: values of the study's limits by name
    failure TEXT,                -- why it failed or was cut
    give_up REAL,                -- J above which its episode may be cut; NULL for never
    started TEXT NOT NULL,       -- UTC, ISO 8601
    seconds TEXT NOT NULL,       -- JSON object: wall time by part
    plant_seconds REAL,          -- s of the robot's time that were flown
    saved_seconds REAL,          -- s of the robot's time that were not, because the trial was cut
    record_checksum INTEGER,     -- CRC-32 of the record
    checksum INTEGER NOT NULL,   -- CRC-32 of all the columns from number on
    episode BLOB                 -- the record: a compressed .npz archive"""

TABLES = f"""
CREATE TABLE about (schema INTEGER NOT NULL);
CREATE TABLE trial (
    number INTEGER PRIMARY KEY,  -- from 1, in the order of asking{_TRIAL}
);
CREATE TABLE taken_back (        -- what was told of a trial and taken back, so that it was out again
    event INTEGER PRIMARY KEY,   -- of the taking back
    number INTEGER NOT NULL,     -- of the trial{_TRIAL}
);
CREATE TABLE flight (            -- experiments beside the search
    name TEXT PRIMARY KEY,
    theta TEXT,                  -- JSON list
    J REAL,
    score TEXT,                  -- JSON object, as in a trial
    failure TEXT,
    record_checksum INTEGER NOT NULL,
    checksum INTEGER NOT NULL,   -- CRC-32 of all the columns above
    episode BLOB NOT NULL
);
"""
TRIAL_COLUMNS = (
    *("number", "phase", "theta", "by_hand", "asked", "told", "outcome", "J", "at_least", "score", "measured"),
    *("failure", "give_up", "started", "seconds", "plant_seconds", "saved_seconds", "record_checksum", "checksum"),
)
# SQLite gives back a REAL as a float, whatever number it was given.
_REAL = ("J", "at_least", "give_up", "plant_seconds", "saved_seconds")
FLIGHT_COLUMNS = ("name", "theta", "J", "score", "failure", "record_checksum", "checksum", "episode")


def trial_row(trial: Asked, episode: Episode | None = None) -> dict[str, Any]:
    """A trial with its record."""
    row: dict[str, Any] = {name: getattr(trial, name, None) for name in TRIAL_COLUMNS[:-2]}
    # SQLite has no negative zero.
    row |= {name: float(row[name]) + 0.0 for name in _REAL if row[name] is not None}
    row["theta"], row["seconds"] = json.dumps(trial.theta.tolist()), json.dumps(trial.seconds)
    row["by_hand"] = int(trial.by_hand)
    if isinstance(trial, Trial):
        row["score"] = None if trial.score is None else json.dumps(asdict(trial.score))
        row["measured"] = None if trial.measured is None else json.dumps(trial.measured)
    return _with_checksums(row, episode)


def trial_of(values: tuple[Any, ...]) -> Asked:
    """The trial whose row has these values of :data:`TRIAL_COLUMNS`: a :class:`Trial` when it was told."""
    row = _verified(dict(zip(TRIAL_COLUMNS, values, strict=True)))
    del row["record_checksum"]
    row |= {
        "theta": np.array(json.loads(row["theta"])),
        "by_hand": bool(row["by_hand"]),
        "seconds": json.loads(row["seconds"]),
        "score": _score(row["score"]),
        "measured": None if row["measured"] is None else json.loads(row["measured"]),
    }
    if row["told"] is None:
        return Asked(**{name: row[name] for name in Asked.__dataclass_fields__})
    return Trial(**row)


def flight_row(flight: Flight) -> dict[str, Any]:
    """A flight with its record."""
    row = {
        "name": flight.name,
        "theta": None if flight.theta is None else json.dumps(flight.theta.tolist()),
        "J": None if flight.score is None else flight.score.J + 0.0,
        "score": None if flight.score is None else json.dumps(asdict(flight.score)),
        "failure": flight.episode.failure,
    }
    return _with_checksums(row, flight.episode)


def flight_of(values: tuple[Any, ...]) -> Flight:
    """The flight whose row has these values of :data:`FLIGHT_COLUMNS`."""
    *plain, blob = values
    row = _verified(dict(zip(FLIGHT_COLUMNS[:-1], plain, strict=True)))
    theta = None if row["theta"] is None else np.array(json.loads(row["theta"]))
    return Flight(row["name"], theta, _score(row["score"]), record_of(blob, row["record_checksum"]))


def record_of(blob: bytes, checksum: int) -> Episode:
    """The record in a row."""
    check_record(blob, checksum)
    return unpack(blob)


def check_record(blob: bytes, checksum: int) -> None:
    """ValueError unless the bytes of a record are those that were stored."""
    if zlib.crc32(blob) != checksum:
        raise ValueError("a record does not match its checksum")


def _with_checksums(row: dict[str, Any], episode: Episode | None) -> dict[str, Any]:
    blob = None if episode is None else pack(episode)
    row["record_checksum"] = None if blob is None else zlib.crc32(blob)
    return row | {"checksum": _checksum(row), "episode": blob}


def _verified(row: dict[str, Any]) -> dict[str, Any]:
    checksum = row.pop("checksum")
    if _checksum(row) != checksum:
        raise ValueError(f"a checksum does not match: {next(iter(row.values()))!r}")
    return row


def _checksum(row: dict[str, Any]) -> int:
    return zlib.crc32(json.dumps(row).encode())


def _score(text: str | None) -> Score | None:
    return None if text is None else Score(**json.loads(text))
