"""A recording of an experiment is read as it was flown, or refused with the line and the value that are wrong."""

import csv
from dataclasses import replace

import numpy as np
import pytest

from socasadi import Circle, LinearMPC, Modal, Origin, SimulatedPlant
from socasadi.campaign import Circle as CircleTask
from socasadi.campaign import RecordingError, Study, fly, read_recording, write_recording
from socasadi.plant import ExternalPlant

THETA = [9.0, 0.7, 0.005, -0.0025, -0.0025, 9.0, 0.7, 0.0, 0.00435, -0.00435]


@pytest.fixture
def study():
    arm = ExternalPlant(0.05, inputs=3, outputs=2)
    return Study(plant=arm, mpc=LinearMPC(Modal()), task=CircleTask(duration=1.0, period=2.0))


@pytest.fixture
def recorded(toy_study, study, tmp_path):
    """An episode, and the file that it was written to, as rows of text that a test may change."""
    controller = study.mpc.controller(THETA)
    episode = fly(toy_study.plant, controller, study.task, seed=1, time_limit=60.0)
    write_recording(episode, tmp_path / "whole.csv")
    return episode, [*csv.reader((tmp_path / "whole.csv").open())]


def save(path, rows):
    with path.open("w", newline="") as file:
        csv.writer(file).writerows(rows)
    return path


def column(rows, name):
    return next(i for i, heading in enumerate(rows[0]) if heading.split(" ")[0] == name)


def test_what_was_written_is_read_back_to_the_last_bit(recorded, study, tmp_path):
    episode, _ = recorded
    back = read_recording(tmp_path / "whole.csv", study)
    for name in ("output", "reference", "tension", "held"):
        np.testing.assert_array_equal(getattr(back, name), getattr(episode, name))
    np.testing.assert_array_equal(back.truth, episode.output)
    scale = study.mpc.input_scale
    assert study.cost.score(back, scale).J == study.cost.score(episode, scale).J


def test_the_header_names_the_units(recorded):
    _, rows = recorded
    assert rows[0] == ["t [s]", "y1 [m]", "y2 [m]", "u1 [N]", "u2 [N]", "u3 [N]", "r1 [m]", "r2 [m]"]
    assert [row[0] for row in rows[1:4]] == ["-0.05", "0.0", "0.05"]


def test_a_file_by_hand_may_be_as_short_as_it_can_be(recorded, study, tmp_path):
    """Plain names, columns anywhere, others beside them, no references, no row before the first, comments."""
    episode, rows = recorded
    chosen = ["u3", "y2", "t", "y1", "u1", "u2"]
    lines = ["# flown on a Tuesday", "u3,battery,y2,t,y1,u1,u2", ""]
    for row in rows[2:]:
        cells = [row[column(rows, name)] for name in chosen]
        lines.append(",".join([cells[0], "11.9", *cells[1:]]))
    (tmp_path / "hand.csv").write_text("\ufeff" + "\r\n".join(lines) + "\r\n")
    back = read_recording(tmp_path / "hand.csv", study)
    np.testing.assert_array_equal(back.output, episode.output)
    np.testing.assert_array_equal(back.tension, episode.tension)
    np.testing.assert_array_equal(back.reference, episode.reference)


def test_inputs_that_were_held_before_are_in_a_row_before_and_count_in_j(study, tmp_path):
    plant = SimulatedPlant(__import__("socasadi").Rod.preset("paper"))
    study = replace(study, task=Origin(duration=1.0), plant=plant)
    theta = [4.6, 0.08, 0.0057, -0.0028, -0.0028, 4.6, 0.08, 0.0, 0.0049, -0.0049]
    episode = fly(plant, study.mpc.controller(theta), study.task, seed=1, time_limit=60.0)
    assert np.abs(episode.held).max() > 1
    write_recording(episode, tmp_path / "origin.csv")
    back = read_recording(tmp_path / "origin.csv", study)
    assert study.cost.score(back, study.mpc.input_scale).J == study.cost.score(episode, study.mpc.input_scale).J


def test_without_that_row_the_robot_rests_on_as_little_as_its_bounds_allow(recorded, study, tmp_path):
    _, rows = recorded
    pulling = replace(study, mpc=replace(study.mpc, input_bounds=((-10.0, 0.5, -10.0), (10.0, 20.0, -1.0))))
    for row in rows[2:-1]:
        row[column(rows, "u2")], row[column(rows, "u3")] = "2", "-2"
    path = save(tmp_path / "pulling.csv", [rows[0], *rows[2:]])
    np.testing.assert_array_equal(read_recording(path, pulling).held, [0.0, 0.5, -1.0])


def test_few_digits_and_a_jittering_clock_are_fine(recorded, study, tmp_path):
    episode, rows = recorded
    random = np.random.default_rng(0)
    for row in rows[2:]:
        row[0] = f"{float(row[0]) + 0.005 * random.uniform(-1, 1):.4f}"
        row[1:] = [f"{float(cell):.4f}" if cell else "" for cell in row[1:]]
    back = read_recording(save(tmp_path / "rounded.csv", rows), study)
    np.testing.assert_allclose(back.output, episode.output, atol=5e-5)


def test_measured_disturbances_come_along(study, tmp_path):
    told = replace(study, mpc=LinearMPC(Modal(inputs=4), measured_disturbances=1))
    rows = [["t", "y1", "y2", "u1", "u2", "u3", "w1"]]
    rows += [[0.05 * k, 0.0, 0.0, 1.0, 0.0, 0.0, k] for k in range(21)]
    back = read_recording(save(tmp_path / "windy.csv", rows), told)
    np.testing.assert_array_equal(back.disturbance[:, 0], np.arange(20))
    write_recording(back, tmp_path / "again.csv")
    np.testing.assert_array_equal(read_recording(tmp_path / "again.csv", told).disturbance, back.disturbance)


def test_one_that_ends_early_is_a_cut_once_it_proves_enough(recorded, study, tmp_path):
    episode, rows = recorded
    running = study.cost.running(episode, study.mpc.input_scale)
    path = save(tmp_path / "short.csv", rows[: 2 + 12])  # heading, row before, 12 rows: 11 samples
    cut = read_recording(path, study, give_up=float(running[10]) * 0.99)
    assert cut.cut == running[10]
    assert len(cut.tension) == 11
    with pytest.raises(RecordingError, match=r"ends at t = 0\.55 s, but the task takes 1 s: 9 rows are missing \(so"):
        read_recording(path, study, give_up=float(running[10]))


def put(line, name, value):
    def change(rows):
        rows[line - 1][column(rows, name)] = value

    return change


def scaled(kind, factor):
    def change(rows):
        for row in rows[1:]:
            for i, heading in enumerate(rows[0]):
                if heading.startswith(kind) and row[i]:
                    row[i] = repr(float(row[i]) * factor)

    return change


def heading(before, after):
    def change(rows):
        rows[0][rows[0].index(before)] = after

    return change


def without(name):
    def change(rows):
        place = column(rows, name)
        for row in rows:
            del row[place]

    return change


FAULTS = {
    "a missing column": (without("u2"), "lacks u2; the columns are t, y1, y2, u1, u2, u3, r1, r2"),
    "half of the references": (without("r2"), "lacks r2"),
    "two of the same": (heading("u2 [N]", "u1 [N]"), "has two columns u1"),
    "an output too many": (heading("y2 [m]", "y3 [m]"), r"has a column 'y3 \[m\]', but this study's are t, y1, y2"),
    "columns from 0": (heading("y1 [m]", "y0"), "has a column 'y0', but this study's are"),
    "a named wrong unit": (heading("y1 [m]", "y1 [mm]"), "has y1 in mm, but m is needed"),
    "outputs in mm": (
        scaled("y", 1e3),
        r"line \d+ \(t = [\d.]+ s\): y\d is -?\d+\.\d+ m, \d+ times the largest .*in m\?",
    ),
    "references in mm": (scaled("r", 1e3), r"line 3 \(t = 0 s\): r1 is 50 m, but the task wants 0\.05: is it in m\?"),
    "another reference": (put(7, "r2", "0.01"), r"line 7 \(t = 0\.2 s\): r2 is 0\.01 m, but the task wants 0\.0293893"),
    "times in ms": (scaled("t", 1e3), "a row every 50 s, but the sample time is 0.05 s; is t in ms"),
    "another sample time": (scaled("t", 2), "a row every 0.1 s, but the sample time is 0.05 s"),
    "a slow clock": (
        scaled("t", 1.06),
        r"line 23: t = 1\.06 s, but 20 samples of 0\.05 s end at 1 s: the clocks do not",
    ),
    "a gap": (lambda rows: rows.pop(8), r"line 9: t = 0\.35 s follows 0\.25 s .*: 1 sample missing"),
    "a late start": (
        lambda rows: [put(i, "t", repr(0.05 * (i - 1)))(rows) for i in range(3, len(rows) + 1)],
        r"line 3: the first sample is at t = 0\.1 s, and 0 is needed",
    ),
    "a row twice": (lambda rows: rows.insert(8, rows[8]), r"line 10: t = 0\.3 s follows 0\.3 s .*not one sample apart"),
    "too short": (lambda rows: rows.pop(), r"ends at t = 0\.95 s, but the task takes 1 s: 1 row is missing; fly"),
    "too long": (
        lambda rows: (
            (put(len(rows), "u1", "0")(rows), put(len(rows), "u2", "0")(rows), put(len(rows), "u3", "0")(rows))
            and rows.append(["1.05", *["0"] * 7])
        ),
        r"line 24: the task of 1 s has 21 rows, this recording 22; remove",
    ),
    "no number": (put(5, "y2", "n/a"), "line 5: y2 is 'n/a', which is no finite number"),
    "a decimal comma": (
        lambda rows: rows[4].__setitem__(slice(1, 2), ["0", "0123"]),
        "line 5: 9 cells under 8 headings; a number takes a point, not a comma",
    ),
    "NaN": (put(5, "y2", "nan"), "line 5: y2 is 'nan', which is no finite number"),
    "an empty cell": (put(6, "u1", ""), "line 6: u1 is empty"),
    "an input beyond its bounds": (
        put(6, "u3", "12.5"),
        r"line 6 \(t = 0\.15 s\): u3 is 12\.5 N, beyond its bounds -10 and 10 N",
    ),
    "nothing but a heading": (lambda rows: rows.__delitem__(slice(1, None)), "holds 0 rows of samples"),
    "nothing": (lambda rows: rows.clear(), "is empty"),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_is_one_sentence_with_its_place_and_value(recorded, study, tmp_path, fault):
    _, rows = recorded
    change, words = FAULTS[fault]
    change(rows)
    with pytest.raises(RecordingError, match=words) as told:
        read_recording(save(tmp_path / "faulty.csv", rows), study)
    assert "\n" not in str(told.value)
    assert str(told.value).startswith(str(tmp_path / "faulty.csv"))


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"t;y1;y2\n0;1,5;2\n", "has semicolons between its columns: save it with commas"),
        (b"t\ty1\ty2\n", "has tabs between its columns"),
        (b"time,left,right\n0,1,2\n", r"lacks t, y1, .*\(its first line is 'time,left,right'\)"),
        (b"\xff\xfe\x00\x01", "is no text in UTF-8"),
        (b't,y1,y2\n0,"1\n",2\n', "line 2: .*a row is one line of numbers between commas"),
        (b"t,y1,y2\n0,1," + b"2" * 200_000 + b"\n", "line 2: .*a row is one line of numbers between commas"),
    ],
)
def test_so_is_a_file_of_another_kind(study, tmp_path, content, words):
    (tmp_path / "other.csv").write_bytes(content)
    with pytest.raises(RecordingError, match=words):
        read_recording(tmp_path / "other.csv", study)


def test_so_is_a_file_that_is_not_there(study, tmp_path):
    with pytest.raises(RecordingError, match=r"there is no recording .*nowhere\.csv"):
        read_recording(tmp_path / "nowhere.csv", study)


def test_other_units_are_those_of_the_plant(study, tmp_path):
    eye = ExternalPlant(0.05, inputs=3, outputs=2, output_unit="px", input_unit="bar")
    seen = replace(
        study, plant=eye, mpc=replace(study.mpc, output_bounds=(-300, 300)), task=Circle(radius=90.0, duration=1.0)
    )
    rows = [["t [s]", "y1 [px]", "y2 [px]", "u1 [bar]", "u2 [bar]", "u3 [bar]"]]
    rows += [[0.05 * k, 80.0, 0.0, 1.0, 0.0, 0.0] for k in range(21)]
    assert read_recording(save(tmp_path / "seen.csv", rows), seen).output[0, 0] == 80.0
    rows[0][1] = "y1 [m]"
    with pytest.raises(RecordingError, match="has y1 in m, but px is needed"):
        read_recording(save(tmp_path / "seen.csv", rows), seen)
