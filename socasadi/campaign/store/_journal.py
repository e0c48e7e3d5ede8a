import contextlib
import fcntl
import os
import sqlite3
import time
import zlib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

from ..experiment import Episode
from ._folder import settle
from ._row import (
    FLIGHT_COLUMNS,
    SCHEMA,
    TABLES,
    TRIAL_COLUMNS,
    flight_of,
    flight_row,
    record_of,
    trial_of,
    trial_row,
)
from ._trial import Asked, Flight, Trial

# What reading damaged bytes raises, from the database down to an array in a record.
_DAMAGE = (
    *(sqlite3.DatabaseError, ValueError, TypeError, KeyError, IndexError, AttributeError, EOFError),
    *(OverflowError, MemoryError, NotImplementedError, zlib.error, BadZipFile),
)


# s for which a writer waits for another: what a colleague asks or tells is soon done.
_PATIENCE = 3.0


class JournalError(RuntimeError):
    """A journal that cannot be read or written, or that another process is writing."""


class Journal:
    """Everything that was asked and measured in a run, in one SQLite file; each ask and each tell is one transaction.

    The file takes every transaction at once, so that it is whole without SQLite's file of changes beside it.

    Parameters
    ----------
    path
        The file.
    writer
        Whether trials will be added. One process at a time can be the writer of a journal.
    create
        Make the file, unless it is there.

    Raises
    ------
    JournalError
        Another process writes it; it is damaged; it is no journal, or one of another version; it cannot be made.
    """

    def __init__(self, path: Path, *, writer: bool = False, create: bool = False) -> None:
        self.path = path
        self._lock = _lock(path) if writer else None
        try:
            self._database = self._open(writer, create)
        except BaseException:
            self._unlock()
            raise

    def _open(self, writer: bool, create: bool) -> sqlite3.Connection:
        if not self.path.exists():
            if not create:
                raise JournalError(
                    f"{self.path.parent} has no {self.path.name}: restore it from a copy, or start anew in another "
                    "folder"
                )
            try:
                _make(self.path)
            except (sqlite3.Error, OSError) as error:
                raise self._unwritable(error) from error
        with self._reading():
            mode = "rw" if writer else _read_mode(self.path)
            database = sqlite3.connect(f"{self.path.resolve().as_uri()}?mode={mode}", uri=True)
            try:
                database.execute("PRAGMA synchronous=FULL")
                database.execute("PRAGMA wal_autocheckpoint=1")
                (state,) = database.execute("PRAGMA quick_check").fetchone()
                if state != "ok":
                    raise sqlite3.DatabaseError(state.splitlines()[0])
                (schema,) = database.execute("SELECT schema FROM about").fetchone()
                if schema != SCHEMA:
                    raise JournalError(
                        f"{self.path} has schema version {schema}, this socasadi reads version {SCHEMA}: read it with "
                        "the socasadi that wrote it (study.json says which), or start anew in another folder"
                    )
            except BaseException:
                database.close()
                raise
        return database

    def close(self) -> None:
        """Close the file and let others write it."""
        self._database.close()
        self._unlock()

    def _unlock(self) -> None:
        if self._lock is not None:
            os.close(self._lock)
            self._lock = None

    def __enter__(self) -> "Journal":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def add_asked(self, asked: Asked) -> None:
        """Store a trial that will be handed out; on return it is on the disk."""
        self._insert("trial", trial_row(asked))

    def add_told(self, trial: Trial, episode: Episode | None) -> None:
        """Store the outcome of a trial that was asked, and its record."""
        row = trial_row(trial, episode)
        with self._writing():
            self._update(row)

    def take_back(self, asked: Asked, event: int) -> None:
        """Let a trial that was told be out again, as ``asked``; what was told of it is kept aside with this event."""
        columns = ", ".join((*TRIAL_COLUMNS, "episode"))
        row = trial_row(asked)
        with self._writing():
            self._database.execute(
                f"INSERT INTO taken_back (event, {columns}) SELECT {event}, {columns} FROM trial WHERE number = ?",
                (asked.number,),
            )
            self._update(row)

    def add_flight(self, flight: Flight) -> None:
        """Store a flight beside the search."""
        self._insert("flight", flight_row(flight))

    def trials(self) -> list[Trial]:
        """All trials that were told, in the order of telling, without their records."""
        return sorted((row for row in self._rows() if isinstance(row, Trial)), key=lambda trial: trial.told)

    def pending(self) -> list[Asked]:
        """All trials that were asked and not told, in the order of asking."""
        return [row for row in self._rows() if not isinstance(row, Trial)]

    def episode(self, number: int) -> Episode | None:
        """Record of one trial; None when it has none, because its controller could not be made or J was told alone.

        Raises
        ------
        KeyError
            There is no such trial.
        """
        with self._reading():
            query = "SELECT episode, record_checksum FROM trial WHERE number = ?"
            row = self._database.execute(query, (number,)).fetchone()
            episode = None if row is None or row == (None, None) else record_of(*row)
        if row is None:
            raise KeyError(f"{self.path} has no trial {number}")
        return episode

    def taken_back(self) -> list[tuple[int, Trial]]:
        """Everything that was told and taken back: the event, and the trial as it was told."""
        with self._reading():
            query = f"SELECT event, {', '.join(TRIAL_COLUMNS)} FROM taken_back ORDER BY event"
            return [(row[0], _told(trial_of(row[1:]))) for row in self._database.execute(query)]

    def flights(self) -> dict[str, Flight]:
        """All flights beside the search, by name."""
        with self._reading():
            query = f"SELECT {', '.join(FLIGHT_COLUMNS)} FROM flight ORDER BY rowid"
            flights = [flight_of(values) for values in self._database.execute(query)]
        return {flight.name: flight for flight in flights}

    def _rows(self) -> list[Asked]:
        """All trials in the order of asking: a :class:`Trial` for those that were told."""
        taken_back = self.taken_back()
        with self._reading():
            query = f"SELECT {', '.join(TRIAL_COLUMNS)} FROM trial ORDER BY number"
            rows = [trial_of(values) for values in self._database.execute(query)]
            events = [row.asked for row in rows]
            in_order = events == sorted(events) and [row.number for row in rows] == list(range(1, len(rows) + 1))
            events += [row.told for row in rows if isinstance(row, Trial)]
            events += [event for at, trial in taken_back for event in (at, trial.told)]
            if not in_order or sorted(events) != list(range(1, len(events) + 1)):
                raise ValueError("trials are missing from their row")
        return rows

    def _update(self, row: Mapping[str, Any]) -> None:
        self._database.execute(
            f"UPDATE trial SET {', '.join(f'{name} = :{name}' for name in row)} WHERE number = :number", row
        )

    def _insert(self, table: str, row: Mapping[str, Any]) -> None:
        with self._writing():
            self._database.execute(
                f"INSERT INTO {table} ({', '.join(row)}) VALUES ({', '.join(f':{name}' for name in row)})", row
            )

    @contextlib.contextmanager
    def _reading(self) -> Iterator[None]:
        try:
            yield
        except _DAMAGE as error:
            raise JournalError(
                f"{self.path} is damaged or no journal of socasadi ({' '.join(str(error).split())}); "
                "restore it from a copy, or start anew in another folder"
            ) from error

    @contextlib.contextmanager
    def _writing(self) -> Iterator[None]:
        try:
            with self._database:
                yield
        except sqlite3.Error as error:
            raise self._unwritable(error) from error

    def _unwritable(self, error: Exception) -> JournalError:
        return JournalError(
            f"{self.path} cannot be written ({error}); what was stored before is safe: mend that, and resume"
        )


def _told(trial: Asked) -> Trial:
    if not isinstance(trial, Trial):
        raise ValueError(f"trial {trial.number} was taken back without having been told")
    return trial


def _make(path: Path) -> None:
    """An empty journal, which comes into its place whole: a file that is cut short was never a journal."""
    scratch = path.with_name(f"{path.name}.new")
    for left in path.parent.glob(f"{scratch.name}*"):
        left.unlink()
    database = sqlite3.connect(scratch)
    try:
        database.executescript(f"PRAGMA journal_mode=WAL; BEGIN; {TABLES} INSERT INTO about VALUES ({SCHEMA}); COMMIT;")
    finally:
        database.close()
    settle(scratch, path)


def _read_mode(path: Path) -> str:
    """A reader that may write tidies SQLite's side files away; on a medium that it may not, there are none."""
    return "rw" if os.access(path, os.W_OK) and os.access(path.parent, os.W_OK) else "ro&immutable=1"


def _taken(handle: int) -> bool:
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True


def _lock(path: Path) -> int:
    """Hold the folder's lock for as long as the file stays open; the kernel lets go of it when the process dies."""
    handle = os.open(path.with_name("lock"), os.O_RDWR | os.O_CREAT, 0o644)
    deadline = time.monotonic() + _PATIENCE
    while not _taken(handle):
        if time.monotonic() > deadline:
            holder = os.read(handle, 32).decode(errors="replace").strip() or "unknown"
            os.close(handle)
            raise JournalError(f"{path.parent} is being written by process {holder}; wait until it is done")
        time.sleep(0.1)
    # On a full disk the name is missing, not the lock.
    with contextlib.suppress(OSError):
        os.ftruncate(handle, 0)
        os.write(handle, str(os.getpid()).encode())
    return handle
