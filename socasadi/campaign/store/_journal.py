import contextlib
import fcntl
import io
import json
import os
import sqlite3
import zlib
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from zipfile import BadZipFile

import numpy as np

from ..experiment import Episode, Score

SCHEMA = 1

_TABLES = """
CREATE TABLE about (schema INTEGER NOT NULL);
CREATE TABLE trial (
    number INTEGER PRIMARY KEY,
    phase TEXT NOT NULL,
    theta TEXT NOT NULL,
    J REAL,
    score TEXT,
    failure TEXT,
    started TEXT NOT NULL,
    seconds TEXT NOT NULL,
    episode BLOB
);
CREATE TABLE flight (
    name TEXT PRIMARY KEY,
    theta TEXT,
    J REAL,
    score TEXT,
    failure TEXT,
    episode BLOB NOT NULL
);
"""


class JournalError(RuntimeError):
    """A journal that cannot be read, or that another process is writing."""


@dataclass(frozen=True, eq=False)
class Trial:
    """One trial as the journal has it.

    Attributes
    ----------
    number
        From 1, in the order of asking.
    phase
        ``"seed"`` or ``"search"``.
    theta
        (size,).
    score
        None when it failed.
    failure
        Why it failed, None when it did not.
    started
        UTC, ISO 8601.
    seconds
        Wall time of the whole ``trial``, and of its parts: ``fit`` and ``acquisition`` of the search, ``design`` of the
        controller, ``plant`` and ``controller`` during the episode.
    """

    number: int
    phase: str
    theta: np.ndarray
    score: Score | None
    failure: str | None
    started: str
    seconds: dict[str, float]

    @property
    def J(self) -> float | None:
        """Cost; None when it failed."""
        return None if self.score is None else self.score.J


@dataclass(frozen=True, eq=False)
class Flight:
    """An experiment beside the search: a probing record, or a check of a controller under fresh noise."""

    name: str
    theta: np.ndarray | None
    score: Score | None
    episode: Episode


class Journal:
    """Everything that was measured in a run, in one SQLite file; each trial is one transaction.

    Parameters
    ----------
    path
        The file; made when ``writer`` and not there.
    writer
        Whether trials will be added. One process at a time can be the writer of a journal.

    Raises
    ------
    JournalError
        Another process writes it; it is damaged; it is no journal, or one of another version.
    """

    def __init__(self, path: Path, *, writer: bool = False) -> None:
        self.path = path
        self._lock = _lock(path) if writer else None
        if not writer and not path.exists():
            raise JournalError(f"there is no journal at {path}")
        # A process that is killed at once may leave an empty file behind.
        fresh = not path.exists() or path.stat().st_size == 0
        with self._reading():
            self._database = sqlite3.connect(
                f"{path.resolve().as_uri()}?mode={'rwc' if writer else _read_mode(path)}", uri=True
            )
            if fresh:
                self._database.executescript(
                    f"PRAGMA journal_mode=WAL; BEGIN; {_TABLES} INSERT INTO about VALUES ({SCHEMA}); COMMIT;"
                )
            self._database.execute("PRAGMA synchronous=FULL")
            (state,) = self._database.execute("PRAGMA quick_check").fetchone()
            if state != "ok":
                raise sqlite3.DatabaseError(state.splitlines()[0])
            (schema,) = self._database.execute("SELECT schema FROM about").fetchone()
        if schema != SCHEMA:
            raise JournalError(f"{path} has schema version {schema}, this socasadi reads version {SCHEMA}")

    def close(self) -> None:
        """Close the file and let others write it."""
        self._database.close()
        if self._lock is not None:
            os.close(self._lock)
            self._lock = None

    def __enter__(self) -> "Journal":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def add_trial(self, trial: Trial, episode: Episode | None) -> None:
        """Store a trial; on return it is on the disk."""
        row = (
            trial.number,
            trial.phase,
            json.dumps(trial.theta.tolist()),
            trial.J,
            _score_text(trial.score),
            trial.failure,
            trial.started,
            json.dumps(trial.seconds),
            None if episode is None else _pack(episode),
        )
        with self._writing():
            self._database.execute("INSERT INTO trial VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?)", row)

    def add_flight(self, flight: Flight) -> None:
        """Store a flight beside the search."""
        theta = None if flight.theta is None else json.dumps(flight.theta.tolist())
        J = None if flight.score is None else flight.score.J
        row = (flight.name, theta, J, _score_text(flight.score), flight.episode.failure, _pack(flight.episode))
        with self._writing():
            self._database.execute("INSERT INTO flight VALUES (?, ?, ?, ?, ?, ?)", row)

    def trials(self) -> list[Trial]:
        """All trials in their order, without their episodes."""
        query = "SELECT number, phase, theta, score, failure, started, seconds FROM trial ORDER BY number"
        with self._reading():
            trials = [
                Trial(number, phase, np.array(json.loads(theta)), _score(score), failure, started, json.loads(seconds))
                for number, phase, theta, score, failure, started, seconds in self._database.execute(query)
            ]
            if [trial.number for trial in trials] != list(range(1, len(trials) + 1)):
                raise ValueError("trials are missing from their row")
        return trials

    def episode(self, number: int) -> Episode | None:
        """Record of one trial; None when its controller could not even be made.

        Raises
        ------
        KeyError
            There is no such trial.
        """
        with self._reading():
            row = self._database.execute("SELECT episode FROM trial WHERE number = ?", (number,)).fetchone()
            episode = None if row is None or row[0] is None else _unpack(row[0])
        if row is None:
            raise KeyError(f"{self.path} has no trial {number}")
        return episode

    def flights(self) -> dict[str, Flight]:
        """All flights beside the search, by name."""
        with self._reading():
            rows = self._database.execute("SELECT name, theta, score, episode FROM flight").fetchall()
            return {
                name: Flight(name, None if theta is None else np.array(json.loads(theta)), _score(score), _unpack(blob))
                for name, theta, score, blob in rows
            }

    @contextlib.contextmanager
    def _reading(self) -> Iterator[None]:
        try:
            yield
        except (sqlite3.DatabaseError, ValueError, TypeError, KeyError, EOFError, zlib.error, BadZipFile) as error:
            raise JournalError(
                f"{self.path} is damaged or no journal of socasadi ({error}); "
                "restore it from a copy, or start anew in another folder"
            ) from error

    @contextlib.contextmanager
    def _writing(self) -> Iterator[None]:
        try:
            with self._database:
                yield
        except sqlite3.Error as error:
            raise JournalError(f"{self.path} cannot be written ({error}); what was stored before is safe") from error


def _read_mode(path: Path) -> str:
    """A reader that may write tidies SQLite's side files away; on a medium that it may not, there are none."""
    return "rw" if os.access(path, os.W_OK) and os.access(path.parent, os.W_OK) else "ro&immutable=1"


def _lock(path: Path) -> int:
    """Hold the folder's lock for as long as the file stays open; the kernel lets go of it when the process dies."""
    handle = os.open(path.with_name("lock"), os.O_RDWR | os.O_CREAT, 0o644)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        holder = os.read(handle, 32).decode(errors="replace").strip() or "unknown"
        os.close(handle)
        raise JournalError(f"{path.parent} is being written by process {holder}; wait for it, or stop it") from None
    os.ftruncate(handle, 0)
    os.write(handle, str(os.getpid()).encode())
    return handle


def _score_text(score: Score | None) -> str | None:
    return None if score is None else json.dumps(asdict(score))


def _score(text: str | None) -> Score | None:
    return None if text is None else Score(**json.loads(text))


_ARRAYS = ("output", "reference", "truth", "tension", "held", "shapes", "disturbance")


def _pack(episode: Episode) -> bytes:
    about = json.dumps([episode.sample_time, episode.fallbacks, episode.failure, episode.seconds])
    buffer = io.BytesIO()
    np.savez_compressed(buffer, about=np.array(about), **{name: getattr(episode, name) for name in _ARRAYS})
    return buffer.getvalue()


def _unpack(blob: bytes) -> Episode:
    with np.load(io.BytesIO(blob), allow_pickle=False) as data:
        sample_time, fallbacks, failure, seconds = json.loads(data["about"].item())
        arrays = {name: data[name] for name in _ARRAYS if name in data}
    return Episode(sample_time, **arrays, fallbacks=fallbacks, failure=failure, seconds=seconds)
