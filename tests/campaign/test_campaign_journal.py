"""The journal: what is in it is right or refused, and what cannot be stored is said."""

import json
import os
import random
import shutil
import sqlite3
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from socasadi import Circle
from socasadi.campaign import Campaign, Journal, JournalError, Result, RunError, assess

ROOT = os.path.dirname(os.path.dirname(__file__))


@pytest.fixture(scope="module")
def journal(tmp_path_factory):
    """Bytes of the journal of a run with trials that are done, cut, failed and out, and with flights beside them."""
    from conftest import ShortCircle, ToyPlant

    from socasadi import LinearMPC, Modal, Study

    mpc, folder = LinearMPC(Modal()), tmp_path_factory.mktemp("journal") / "run"
    counts = {"seed_points": 6, "iterations": 0, "verifications": 1}
    study = Study(plant=ToyPlant(), mpc=mpc, task=ShortCircle(), give_up=3.0, **counts)
    assess(study.run(folder, progress=None))
    with Campaign(replace(study, iterations=3), folder, resume=True) as campaign:
        campaign.tell(campaign.ask().number, failed="fell")
        campaign.ask()
    return (folder / "journal.sqlite").read_bytes()


def content(path):
    """All that a journal says, its records too."""
    with Journal(path) as journal:
        rows = [{**vars(row), "theta": row.theta.tolist()} for row in (*journal.trials(), *journal.pending())]
        records = [journal.episode(row["number"]) for row in rows]
        flights = journal.flights()
    arrays = [None if record is None else (record.output.tolist(), record.tension.tolist()) for record in records]
    beside = {
        name: (flight.score, None if flight.theta is None else flight.theta.tolist(), flight.episode.output.tolist())
        for name, flight in flights.items()
    }
    return rows, arrays, beside


def refusal(path, whole):
    """What reading a journal says against it; "" when it says all that it did."""
    try:
        assert content(path) == whole
    except JournalError as error:
        return str(error)
    return ""


class TestDamage:
    @pytest.fixture
    def path(self, tmp_path):
        return tmp_path / "journal.sqlite"

    def test_it_holds_trials_of_every_kind(self, journal, path):
        path.write_bytes(journal)
        rows, _, beside = content(path)
        assert {row.get("outcome") for row in rows} == {"done", "cut", "failed", None}
        assert {"probe 1", "probe 2"} < set(beside)

    @pytest.mark.parametrize("seed", range(4))
    def test_flipped_bytes_are_refused_or_change_nothing(self, journal, path, seed):
        path.write_bytes(journal)
        whole, random_ = content(path), random.Random(seed)
        refused = 0
        for _ in range(120):
            damaged = bytearray(journal)
            for _ in range(random_.choice((1, 1, 10, 200))):
                damaged[random_.randrange(len(damaged))] ^= random_.randrange(1, 256)
            path.write_bytes(damaged)
            said = refusal(path, whole)
            assert said.count("\n") == 0
            refused += said != ""
            for left in path.parent.glob("journal.sqlite-*"):
                left.unlink()
        assert refused > 40

    def test_one_that_was_cut_anywhere_is_refused(self, journal, path):
        random_ = random.Random(1)
        cuts = {0, 1, 15, 16, 99, 100, 101, *range(512, len(journal), 4096), len(journal) - 4096}
        for length in sorted(cuts | {random_.randrange(len(journal) - 4096) for _ in range(60)}):
            path.write_bytes(journal[:length])
            with pytest.raises(JournalError, match="damaged or no journal"):
                content(path)
            assert path.read_bytes() == journal[:length]

    @pytest.mark.parametrize("number", [1, 3, 7])
    def test_a_row_that_was_taken_out_is_missed(self, journal, path, number):
        path.write_bytes(journal)
        with sqlite3.connect(path) as database:
            database.execute("DELETE FROM trial WHERE number = ?", (number,))
        with pytest.raises(JournalError, match="trials are missing"):
            content(path)

    @pytest.mark.parametrize("change", ["J = 0.5", "theta = '[1]'", "told = NULL", "outcome = 'failed'"])
    def test_a_value_that_was_changed_by_hand_is_noticed(self, journal, path, change):
        path.write_bytes(journal)
        with sqlite3.connect(path) as database:
            database.execute(f"UPDATE trial SET {change} WHERE number = 2")
        with pytest.raises(JournalError, match="a checksum does not match: 2"):
            content(path)

    def test_a_broken_record_is_said_when_it_is_read_and_before_anything_is_added(self, journal, path):
        path.write_bytes(journal)
        with sqlite3.connect(path) as database:
            (blob,) = database.execute("SELECT episode FROM trial WHERE number = 2").fetchone()
            broken = blob[:300] + bytes(200) + blob[500:]
            database.execute("UPDATE trial SET episode = ? WHERE number = 2", (broken,))
        with Journal(path) as journal_, pytest.raises(JournalError, match="damaged"):
            journal_.episode(2)
        with pytest.raises(JournalError, match="damaged"):
            Journal(path, writer=True)

    @pytest.mark.parametrize("foreign", ["text", "letters", "about"])
    def test_what_is_no_journal_is_refused_and_left_alone(self, toy_study, tmp_path, foreign):
        run, study = tmp_path / "run", replace(toy_study, task=Circle(duration=1.0), iterations=0)
        study.run(run, progress=None)
        path = run / "journal.sqlite"
        path.unlink()
        if foreign == "text":
            path.write_bytes(b"not a database at all" * 200)
        else:
            with sqlite3.connect(path) as database:
                database.execute(f"CREATE TABLE {foreign} (text)")
        before = path.read_bytes()
        for use in (lambda: study.run(run, resume=True, progress=None), lambda: Result.open(run).trials):
            with pytest.raises(JournalError, match="damaged or no journal of socasadi"):
                use()
        assert path.read_bytes() == before

    def test_one_of_another_schema_is_refused_with_what_to_do(self, toy_study, tmp_path):
        replace(toy_study, iterations=0).run(tmp_path / "run", progress=None)
        with sqlite3.connect(tmp_path / "run" / "journal.sqlite") as database:
            database.execute("UPDATE about SET schema = 1")
        with pytest.raises(JournalError, match="schema version 1, this socasadi reads version 3: read it with the soc"):
            toy_study.run(tmp_path / "run", resume=True, progress=None)

    @pytest.mark.parametrize("lost", ["empty", "missing"])
    def test_a_journal_that_is_lost_is_not_begun_anew(self, toy_study, tmp_path, lost):
        study = replace(toy_study, task=Circle(duration=1.0), iterations=0)
        study.run(tmp_path / "run", progress=None)
        path = tmp_path / "run" / "journal.sqlite"
        path.unlink() if lost == "missing" else path.write_bytes(b"")
        for use in (lambda: study.run(tmp_path / "run", resume=True), lambda: Result.open(tmp_path / "run").trials):
            with pytest.raises(JournalError, match="restore it from a copy, or start anew in another folder"):
                use()

    def test_settings_that_are_lost_are_not_made_anew(self, toy_study, tmp_path):
        result = replace(toy_study, iterations=0).run(tmp_path / "run", progress=None)
        (result.folder / "figures").mkdir()
        (result.folder / "study.json").unlink()
        with pytest.raises(RunError, match=r"it has no study\.json"):
            toy_study.run(tmp_path / "run", resume=True)


def test_a_start_that_was_killed_leaves_nothing_in_the_way(toy_study, tmp_path):
    """Whatever of the folder's first files is there: the study is begun, for nothing was asked."""
    whole = replace(toy_study, iterations=0).run(tmp_path / "whole", progress=None)
    for i, left in enumerate(
        [
            (),
            ("lock",),
            ("lock", "journal.sqlite.new", "journal.sqlite.new-journal"),
            ("journal.sqlite.new-wal", "study.json.new"),
        ]
    ):
        folder = tmp_path / f"run{i}"
        folder.mkdir()
        for name in left:
            (folder / name).write_bytes(b"half of")
        again = replace(toy_study, iterations=0).run(folder, resume=True, progress=None)
        assert [trial.J for trial in again.trials] == [trial.J for trial in whole.trials]
    folder = tmp_path / "settings missing"
    folder.mkdir()
    with Journal(folder / "journal.sqlite", create=True):
        shutil.copytree(folder, open_ := tmp_path / "settings missing, journal open")
    assert {"journal.sqlite-wal", "journal.sqlite-shm"} <= {file.name for file in open_.iterdir()}
    for each in (folder, open_):
        assert len(replace(toy_study, iterations=0).run(each, resume=True, progress=None).trials) == 6


def test_any_sqlite_reads_it_and_its_schema_explains_it(toy_study, tmp_path):
    study = replace(toy_study, iterations=0)
    result = study.run(tmp_path / "run", progress=None)
    with sqlite3.connect(tmp_path / "run" / "journal.sqlite") as database:
        rows = database.execute("SELECT number, theta, outcome, J, at_least, give_up FROM trial ORDER BY number")
        for (number, theta, outcome, J, at_least, give_up), trial in zip(rows, result.trials, strict=True):
            assert (number, json.loads(theta), J) == (trial.number, trial.theta.tolist(), trial.J)
            assert (outcome == "cut") == (at_least is not None and at_least > give_up)
        query = "SELECT sql FROM sqlite_master WHERE name IN ('trial', 'taken_back')"
        schemas = [schema for (schema,) in database.execute(query)]
    for schema in schemas:
        columns = [line for line in schema.splitlines()[1:] if not line.startswith(")")]
        assert len(columns) > 15
        assert all("-- " in line for line in columns)


def test_asks_and_tells_are_counted_together_in_the_order_in_which_they_happened(toy_study, tmp_path):
    with Campaign(toy_study, tmp_path / "run") as campaign:
        one, two = campaign.ask(), campaign.ask()
        first = campaign.tell(two.number, cost=3.0)
        three = campaign.ask()
        last = campaign.tell(one.number, failed="fell")
    assert [one.asked, two.asked, first.told, three.asked, last.told] == [1, 2, 3, 4, 5]
    with Journal(tmp_path / "run" / "journal.sqlite") as journal:
        assert [trial.number for trial in journal.trials()] == [2, 1]
        assert [asked.number for asked in journal.pending()] == [3]


class TestFullDisk:
    SCRIPT = (
        "import resource, sys; sys.path.insert(0, sys.argv[2])\n"
        "from conftest import ToyPlant, ShortCircle\n"
        "from socasadi import *\n"
        "from socasadi.campaign import JournalError\n"
        "study = Study(plant=ToyPlant(), mpc=LinearMPC(Modal()), task=ShortCircle(), seed_points=60, iterations=0)\n"
        "if size := int(sys.argv[3]): resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))\n"
        "try: study.run(sys.argv[1], resume=True)\n"
        "except JournalError as error: sys.exit(str(error))\n"
    )

    def run(self, folder, size=0):
        command = [sys.executable, "-c", self.SCRIPT, str(folder), ROOT, str(size)]
        return subprocess.run(command, capture_output=True, text=True, timeout=100)

    def check(self, folder, stopped, again):
        lines = stopped.stdout.splitlines()
        assert 5 < len(lines) < 60
        assert stopped.returncode == 1
        assert "journal.sqlite cannot be written" in stopped.stderr
        assert "what was stored before is safe: mend that, and resume" in stopped.stderr
        assert len(stopped.stderr.strip().splitlines()) == 1
        assert again.returncode == 0, again.stderr
        assert len(lines) + len(again.stdout.splitlines()) == 60
        assert len({line.split("/")[0] for line in lines + again.stdout.splitlines()}) == 60

    def test_a_file_that_cannot_grow_stops_the_campaign_and_loses_no_stored_trial(self, tmp_path):
        folder = tmp_path / "run"
        stopped = self.run(folder, 100_000)
        with Journal(folder / "journal.sqlite") as journal:
            stored = len(journal.trials())
        assert stored == len(stopped.stdout.splitlines())
        self.check(folder, stopped, self.run(folder))

    def test_nor_does_a_full_file_system(self, tmp_path):
        mount = ["mount", "-t", "tmpfs", "-o", "size=250k", "tmpfs", str(tmp_path)]
        if not shutil.which("mount") or subprocess.run(mount, capture_output=True).returncode:
            pytest.skip("file systems cannot be mounted here")
        try:
            folder = tmp_path / "run"
            stopped = self.run(folder)
            subprocess.run(["mount", "-o", "remount,size=10m", str(tmp_path)], check=True)
            self.check(folder, stopped, self.run(folder))
        finally:
            subprocess.run(["umount", str(tmp_path)], check=True)

    def test_with_no_room_at_all_nothing_is_begun(self, toy_study, tmp_path):
        stopped = self.run(tmp_path / "run", 100)
        assert stopped.returncode == 1
        assert "cannot be written" in stopped.stderr
        assert self.run(tmp_path / "run").returncode == 0


def test_what_a_plant_says_when_it_fails_is_stored_whatever_it_is(toy_study, tmp_path):
    said = "broken \udce9 \x00 \u2603\nand more"

    class Odd(type(toy_study.plant)):
        def step(self, tension, tip_force=None):
            raise RuntimeError(said)

    study = replace(toy_study, plant=Odd(), seed_points=1, iterations=0)
    (trial,) = study.run(tmp_path / "run", progress=None).trials
    assert trial.failure == "RuntimeError: broken \\udce9 \x00 \u2603\nand more"


def test_numbers_come_back_bit_for_bit(toy_study, tmp_path):
    with Campaign(toy_study, tmp_path / "run") as campaign:
        theta = campaign.ask().theta
        J = campaign.tell(1, cost=1 / 3).J
    with Campaign(toy_study, tmp_path / "run", resume=True) as campaign:
        np.testing.assert_array_equal(campaign.trials[0].theta, theta)
        assert campaign.trials[0].J == J == 1 / 3
