"""One run folder and several processes: who writes, who only reads, and what children of a writer inherit."""

import multiprocessing
import os
import signal
import sqlite3
import subprocess
import sys
import time

import pytest

from socasadi import Campaign
from socasadi.campaign import Journal, JournalError
from socasadi.campaign.store import journal_path


@pytest.fixture
def journal(toy_study, tmp_path):
    """The path of a journal with one trial that was told."""
    with Campaign(toy_study, tmp_path / "run") as campaign:
        campaign.tell(campaign.ask().number, cost=3.0)
    return journal_path(tmp_path / "run")


TAKE_BACK = """
    from socasadi.campaign import Asked
    (told,) = writer.trials()
    writer.take_back(Asked(**{name: getattr(told, name) for name in Asked.__dataclass_fields__}), 3)
    os.kill(os.getpid(), signal.SIGKILL)
"""


def start_with(journal, line):
    """A process that holds the journal as its writer and then does that."""
    code = f"""
import os, signal, time
from pathlib import Path
from socasadi.campaign import Journal
with Journal(Path({str(journal)!r}), writer=True) as writer:
    {line}
"""
    return subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True)


def test_a_child_that_was_forked_by_a_writer_does_not_hold_the_lock(journal):
    with Journal(journal, writer=True):
        child = multiprocessing.get_context("fork").Process(target=time.sleep, args=(60,))
        child.start()
    try:
        with Journal(journal, writer=True) as again:
            assert len(again.trials()) == 1
    finally:
        child.kill()
        child.join()


def test_nor_does_one_whose_parent_was_killed(journal):
    ending = "child = os.fork() or time.sleep(60); print(child, flush=True); os.kill(os.getpid(), signal.SIGKILL)"
    parent = start_with(journal, ending)
    child = int(parent.stdout.readline())
    assert parent.wait() == -signal.SIGKILL
    try:
        with Journal(journal, writer=True) as again:
            assert len(again.trials()) == 1
    finally:
        os.kill(child, signal.SIGKILL)


def test_a_writer_that_lives_is_named(journal):
    writer = start_with(journal, "print(flush=True); time.sleep(60)")
    writer.stdout.readline()
    try:
        with pytest.raises(JournalError, match=f"being written by process {writer.pid}"):
            Journal(journal, writer=True)
    finally:
        writer.kill()
        writer.wait()


@pytest.fixture
def may_only_read(monkeypatch):
    monkeypatch.setattr(os, "access", lambda path, mode: mode != os.W_OK)


def files(journal):
    return {file.name: file.read_bytes() for file in journal.parent.iterdir()}


def test_one_who_may_only_read_sees_what_is_there_and_changes_nothing(journal, may_only_read):
    before = files(journal)
    with Journal(journal) as reader:
        assert [trial.J for trial in reader.trials()] == [3.0]
    assert files(journal) == before


def test_and_what_a_writer_stores_meanwhile(toy_study, journal, may_only_read):
    with Campaign(toy_study, journal.parent, resume=True) as campaign:
        for number in range(2, 7):
            campaign.tell(campaign.ask().number, cost=1.0)
            with Journal(journal) as reader:
                assert len(reader.trials()) == number


@pytest.mark.parametrize("index", [True, False])
def test_and_what_a_writer_stored_that_was_killed(journal, may_only_read, index):
    with sqlite3.connect(journal) as reading:
        # While somebody reads, SQLite cannot put a change into the file itself.
        reading.execute("BEGIN")
        reading.execute("SELECT * FROM trial").fetchall()
        start_with(journal, TAKE_BACK).wait()
        left = {name: data for name, data in files(journal).items() if index or not name.endswith("-shm")}
    reading.close()
    assert "journal.sqlite-wal" in left
    copy = journal.parent.parent / "copy"
    copy.mkdir()
    for name, data in left.items():
        (copy / name).write_bytes(data)
    with Journal(journal_path(copy)) as reader:
        assert not reader.trials()
        assert [trial.J for _, trial in reader.taken_back()] == [3.0]


def test_colleagues_of_a_group_share_all_files(toy_study, tmp_path):
    before = os.umask(0o002)
    try:
        Campaign(toy_study, tmp_path / "run").close()
    finally:
        os.umask(before)
    modes = {file.name: file.stat().st_mode & 0o777 for file in (tmp_path / "run").iterdir()}
    assert modes == dict.fromkeys(("lock", "journal.sqlite", "study.json"), 0o664)
