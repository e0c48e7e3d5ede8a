import contextlib
import os
import shutil
import sqlite3
import tempfile
import zlib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

from ..experiment import Episode
from ._folder import settle
from ._lock import LockedError, lock, unlock
from ._row import (
    FLIGHT_COLUMNS,
    SCHEMA,
    TABLES,
    TRIAL_COLUMNS,
    check_record,
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
        self._closing = contextlib.ExitStack()
        try:
            if writer:
                self._closing.callback(unlock, lock(path.with_name("lock")))
            self._database = self._open(writer, create)
        except LockedError as error:
            raise JournalError(f"{path.parent} is being written by process {error}; wait until it is done") from None
        except BaseException:
            self._closing.close()
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
            database = sqlite3.connect(self._uri(writer), uri=True)
            self._closing.callback(database.close)
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
            if writer:  # nothing is added to what is damaged
                for table in ("trial", "taken_back", "flight"):
                    query = f"SELECT episode, record_checksum FROM {table} WHERE episode IS NOT NULL"
                    for blob, checksum in database.execute(query):
                        check_record(blob, checksum)
        return database

    def _uri(self, writer: bool) -> str:
        """How SQLite opens the file, also for a reader who may not write anything."""
        path = self.path.resolve()
        if writer or (os.access(path, os.W_OK) and os.access(path.parent, os.W_OK)):
            return f"{path.as_uri()}?mode=rw"  # which tidies SQLite's side files away
        changes, index = (path.with_name(path.name + end) for end in ("-wal", "-shm"))
        if index.exists():
            return f"{path.as_uri()}?mode=ro"
        if not changes.exists():
            return f"{path.as_uri()}?mode=ro&immutable=1"
        # A writer was killed, and left changes that SQLite cannot read without making their index.
        folder = Path(self._closing.enter_context(tempfile.TemporaryDirectory()))
        for file in (path, changes):
            shutil.copyfile(file, folder / file.name)
        return f"{(folder / path.name).as_uri()}?mode=rw"

    def close(self) -> None:
        """Close the file and let others write it."""
        self._closing.close()

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
    os.close(os.open(scratch, os.O_RDWR | os.O_CREAT, 0o666))  # SQLite would keep others of the group out
    database = sqlite3.connect(scratch)
    try:
        database.executescript(f"PRAGMA journal_mode=WAL; BEGIN; {TABLES} INSERT INTO about VALUES ({SCHEMA}); COMMIT;")
    finally:
        database.close()
    settle(scratch, path)
