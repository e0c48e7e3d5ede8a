"""The page of a run: one file, complete, and honest about what is missing."""

import base64
import json
import re
import shutil
import sqlite3
from functools import partial
from html import escape
from html.parser import HTMLParser

import numpy as np
import pytest
from report_support import MODEL, small_run

from socasadi import Circle, ExternalPlant, LinearMPC, Study
from socasadi.campaign import Campaign, Result
from socasadi.feasibility import check
from socasadi.report import html_report, write_report
from socasadi.report.html import _data, _pieces
from socasadi.tune import Estimate


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    result = small_run(tmp_path_factory.mktemp("report") / "run")
    result.export(result.folder / "controller")
    return result


@pytest.fixture(scope="module")
def page(result):
    return html_report(result.folder).read_text(encoding="utf-8")


@pytest.fixture
def folder(result, tmp_path, monkeypatch):
    """A copy of the run to be damaged; what its check says at length is told of the whole one."""
    monkeypatch.setattr(_pieces, "check", partial(check, quick=True))
    return shutil.copytree(result.folder, tmp_path / "run")


@pytest.fixture
def external():
    """A study of a robot that is flown elsewhere."""
    return Study(plant=ExternalPlant(sample_time=0.05, inputs=3, outputs=2), mpc=LinearMPC(MODEL), task=Circle())


def data(page):
    return json.loads(re.search(r'<script type="application/json" id="data">(.*?)</script>', page, re.S)[1])


def unpacked(packed):
    values = np.frombuffer(base64.b64decode(packed["data"]), dtype="<i2").reshape(packed["shape"])
    return packed["scale"] * values


def missing(page):
    """What the page says it lacks."""
    listed = re.search(r'<section id="missing".*?</section>', page, re.S)
    return listed[0] if listed else ""


class Fetched(HTMLParser):
    """Collects every address that a browser would fetch."""

    def __init__(self):
        super().__init__()
        self.addresses = []

    def handle_starttag(self, tag, attrs):
        names = ("src", "href") if tag != "a" else ()
        self.addresses += [value for name, value in attrs if name in names]


def test_the_page_is_one_file_under_8_mb_that_fetches_nothing(page):
    assert len(page.encode("utf-8")) < 8e6
    fetched = Fetched()
    fetched.feed(re.sub(r"<script>.*?</script>", "", page, flags=re.S))
    assert all(address.startswith("data:") for address in fetched.addresses)
    assert "@import" not in page.split("<body>")[0]


def test_a_whole_run_lacks_nothing(page):
    assert missing(page) == ""


def test_the_page_holds_every_trial_as_it_was_flown(result, page):
    told = data(page)
    assert [trial["n"] for trial in told["trials"]] == [trial.number for trial in result.trials]
    assert told["best"] == result.best.number
    assert told["shown"] == result.chosen.number
    episode, kept = result.episode(told["best"]), told["episodes"][str(told["best"])]
    for name, values in (("truth", episode.truth), ("input", episode.tension), ("shapes", episode.shapes)):
        assert unpacked(kept[name]) == pytest.approx(values, abs=float(np.abs(values).max()) / 60000)
    assert kept["every"] == pytest.approx(0.25)


def test_the_page_names_theta_with_units_and_where_it_is_likely(result, page):
    for entry in result.study.mpc.model.entries:
        assert f'<th scope="row">{entry.name}</th>' in page
    assert "rad/s" in page
    for found in data(page)["slices"]:
        low, high = found["likely"]
        assert found["values"][0] <= low <= high <= found["values"][-1]
        assert np.all(np.array(found["low"]) <= np.array(found["middle"]))
        assert np.all(np.array(found["middle"]) <= np.array(found["high"]))


def test_the_page_says_why_another_trial_than_the_best_is_exported(result, folder, page, monkeypatch):
    words = "exported: trial"
    assert (words in page) == (result.chosen.number != result.best.number)
    other = next(trial for trial in result.trials if trial.number != result.best.number)
    monkeypatch.setattr(Result, "chosen", other)
    page = html_report(folder).read_text(encoding="utf-8")
    assert f"trial {result.best.number}; {words} {other.number}, the best of those flown again" in page


def test_a_heading_stands_as_the_cells_below_it(page):
    for table in re.findall(r"<table.*?</table>", page, re.S):
        heads = re.findall(r"<th scope=\"col\"([^>]*)>", table)
        row = re.findall(r"<t[hd]([^>]*)>", re.split(r"<tbody>", table)[1].split("</tr>")[0])
        for head, cell in list(zip(heads, row, strict=False))[1:]:  # the first ones are all at the left
            assert ('class="left"' in head) == ('class="left"' in cell) or "findings" in table


def test_an_estimate_that_says_nothing_gives_its_tile_no_number(result, folder, monkeypatch):
    worthless = Estimate(0, result.trials[0].theta, 3141.0, -1.0, 9e9)
    monkeypatch.setattr(Result, "best_estimated", worthless)
    page = html_report(folder).read_text(encoding="utf-8")
    assert "too few trials to say what the best is worth without noise" in page
    assert "3141" not in page.split("<section")[0]


def test_the_page_says_what_the_check_and_the_export_said(page):
    assert "all of the reference can be held" in page
    assert "this machine" in page
    assert re.search(r"<summary>Settings: mpc</summary>", page)
    assert "sha256 of the journal" in page


def test_what_a_robot_says_cannot_write_into_the_page(external, tmp_path):
    told = "</script><script>alert(1)</script> & <b>"
    with Campaign(external, tmp_path / "run") as campaign:
        campaign.tell(campaign.ask().number, failed=told)
    page = html_report(tmp_path / "run").read_text(encoding="utf-8")
    assert "<script>alert" not in page
    assert data(page)["trials"][0]["failure"] == told


@pytest.mark.parametrize(
    ("lost", "said"),
    [
        ("sobol", "the Sobol baseline"),
        ("controller", "the exported controller"),
        ("journal.sqlite", "the journal"),
    ],
)
def test_what_is_gone_is_named_and_the_rest_is_shown(folder, lost, said):
    shutil.rmtree(folder / lost) if (folder / lost).is_dir() else (folder / lost).unlink()
    written = write_report(folder)
    page = written.file.read_text(encoding="utf-8")
    assert written.damaged == (lost == "journal.sqlite")
    assert all(escape(line) in missing(page) for line in written.lacks)
    assert said in missing(page)
    assert "all of the reference can be held" in page


def test_without_settings_the_trials_are_still_shown(folder):
    (folder / "study.json").write_text('{"settings": ')
    page = html_report(folder).read_text(encoding="utf-8")
    assert "study.json" in missing(page)
    assert len(data(page)["trials"]) == 7
    assert data(page)["episodes"]


@pytest.mark.parametrize("settings", ['{"settings": ', '{"settings": {}}', None])
def test_a_run_without_its_settings_is_damaged(folder, settings):
    (folder / "study.json").unlink() if settings is None else (folder / "study.json").write_text(settings)
    assert write_report(folder).damaged


def test_a_study_that_only_its_script_makes_is_no_damage(folder):
    told = (folder / "study.json").read_text()
    (folder / "study.json").write_text(told.replace('"socasadi.campaign.experiment.Circle"', '"script.Mine"'))
    written = write_report(folder)
    assert any("can only be made by the study script" in line for line in written.lacks)
    assert not written.damaged


def test_a_damaged_record_costs_its_own_trial_alone(result, folder):
    number = next(trial.number for trial in result.trials if trial.number != result.best.number)
    with sqlite3.connect(folder / "journal.sqlite") as journal:
        journal.execute("UPDATE trial SET episode = x'00112233' WHERE number = ?", (number,))
    written = write_report(folder)
    assert written.damaged
    page = written.file.read_text(encoding="utf-8")
    assert f"the record of trial {number}" in missing(page)
    assert set(data(page)["episodes"]) == {str(t.number) for t in result.trials if t.number != number}


def test_a_damaged_journal_is_said_and_the_check_is_shown(folder):
    (folder / "journal.sqlite").write_bytes(b"no journal at all" * 100)
    page = html_report(folder).read_text(encoding="utf-8")
    assert "the journal" in missing(page)
    assert "all of the reference can be held" in page


def test_a_folder_without_a_run_is_refused(tmp_path):
    with pytest.raises(ValueError, match="holds no run"):
        html_report(tmp_path)
    with pytest.raises(FileNotFoundError, match="no run folder"):
        html_report(tmp_path / "nowhere")


def test_the_page_of_a_robot_that_is_flown_elsewhere_has_no_rod(external, tmp_path):
    with Campaign(external, tmp_path / "run") as campaign:
        campaign.tell(campaign.ask().number, cost=4.0)
    page = html_report(tmp_path / "run").read_text(encoding="utf-8")
    assert data(page)["rod"] is None
    assert data(page)["trials"][0]["J"] == 4.0
    assert missing(page).count("<li>") == 1  # the controller that is not exported yet


def test_a_long_run_keeps_its_page_small_and_its_best_trials(result):
    """Room for two or three episodes: the best comes first, and the page says which are there."""
    pieces = _pieces.Pieces.gather(result.folder)
    told = _data.page_data(pieces, room=15_000)
    assert 1 <= len(told["episodes"]) < 7
    assert str(result.best.number) in told["episodes"]
    assert len(told["trials"]) == 7


def test_what_is_no_finite_number_is_told_from_zero_and_spoils_no_other():
    values = np.array([0.01, -0.02, np.inf, np.nan, 0.015, 1e6])
    whole = np.frombuffer(base64.b64decode(_data.packed(values)["data"]), dtype="<i2")
    assert list(whole == -32768) == [False, False, True, True, False, False]
    assert unpacked(_data.packed(values))[[0, 1, 4]] == pytest.approx([0.01, -0.02, 0.015], rel=0.05)
