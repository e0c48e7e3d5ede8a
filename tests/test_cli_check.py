"""`socasadi check`, as a user runs it."""

from pathlib import Path

import numpy as np
import pytest
from command_support import socasadi

from socasadi import Rod, SimulatedPlant
from socasadi.campaign import Campaign, Episode, Result, probe, read_probe, write_recording
from socasadi.model import identify

ROOT = Path(__file__).parent.parent
EXTERNAL = """
from socasadi import *
arm = ExternalPlant(sample_time=0.05, inputs=3, outputs=2, name="the arm")
study = Study(plant=arm, mpc=LinearMPC(Modal()), task=Circle(radius={radius}))
"""


def test_a_sound_study_passes_with_a_picture(tmp_path):
    done = socasadi("check", ROOT / "studies" / "circle.py", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "nothing stands against it" in done.stdout
    assert (tmp_path / "runs" / "circle-check" / "reach.png").stat().st_size > 5000


def test_an_infeasible_study_ends_with_1_and_what_to_change(tmp_path):
    source = (ROOT / "studies" / "circle.py").read_text()
    (tmp_path / "study.py").write_text(source.replace("radius=0.05", "radius=0.15"))
    done = socasadi("check", "study.py", "--figures", "here", cwd=tmp_path)
    assert done.returncode == 1
    assert "infeasible: reach, output bounds" in done.stdout
    assert "-> a smaller reference" in done.stdout
    assert (tmp_path / "here" / "reach.pdf").exists()


def test_run_says_first_what_stands_against_it(tmp_path):
    source = (ROOT / "studies" / "circle.py").read_text()
    short = source.replace("seed_points=10", "seed_points=1").replace("iterations=100", "iterations=0")
    short = short.replace("period=20.0", "period=20.0, duration=1.0").replace(
        "    cost=", "    verifications=0, cost=", 1
    )
    (tmp_path / "study.py").write_text(short.replace("noise=1e-3", "noise=0.03"))
    done = socasadi("run", "study.py", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert done.stdout.index("noise") < done.stdout.index("search:")
    assert "a better sensor" in done.stdout


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """A probing record of the preset "paper" as CSV."""
    record = probe(SimulatedPlant(Rod.preset("paper")), (-10, 10), seed=1)
    nothing = np.zeros_like(record.output)
    episode = Episode(0.05, record.output, nothing, record.output, record.tension, np.zeros(3), np.zeros((0, 0, 3)))
    file = tmp_path_factory.mktemp("probe") / "probe.csv"
    write_recording(episode, file)
    return file


def test_a_real_robot_is_checked_by_its_record_and_its_data_sheet(tmp_path, recorded):
    (tmp_path / "arm.py").write_text(EXTERNAL.format(radius=0.05))
    unknown = socasadi("check", "arm.py", cwd=tmp_path)
    assert unknown.returncode == 0
    assert "--record" in unknown.stdout
    assert "nothing stands against it" in socasadi("check", "arm.py", "--record", recorded, cwd=tmp_path).stdout
    sheet = "length = 0.6\nbending_stiffness = 0.636\nmass_per_length = 2.83\ncable_offset = 0.02\n"
    (tmp_path / "arm.toml").write_text(sheet)
    done = socasadi("check", "arm.py", "--spec", "arm.toml", "--record", recorded, cwd=tmp_path)
    assert "by what is known from the data sheet and the probing record" in done.stdout
    (tmp_path / "arm.py").write_text(EXTERNAL.format(radius=0.2))
    assert socasadi("check", "arm.py", "--spec", "arm.toml", cwd=tmp_path).returncode == 1


@pytest.mark.parametrize(
    ("arguments", "fault"),
    [
        (("nowhere.py",), "nowhere.py"),
        (("arm.py", "--record", "none.csv"), "there is no recording none.csv"),
        (("arm.py", "--spec", "none.toml"), "there is no data sheet none.toml"),
    ],
)
def test_a_slip_is_answered_in_a_sentence(tmp_path, arguments, fault):
    (tmp_path / "arm.py").write_text(EXTERNAL.format(radius=0.05))
    done = socasadi("check", *arguments, cwd=tmp_path)
    assert done.returncode != 0
    assert fault in done.stderr
    assert "Traceback" not in done.stderr


def test_a_campaign_is_not_begun_from_a_record_in_another_unit(tmp_path, recorded):
    (tmp_path / "arm.py").write_text(EXTERNAL.format(radius=0.05))
    lines = [line.split(",") for line in recorded.read_text().splitlines()]
    heading = [name.split(" ")[0] for name in lines[0]]
    rows = [
        [str(1e3 * float(x)) if n[0] == "y" and x else x for n, x in zip(heading, row, strict=True)]
        for row in lines[1:]
    ]
    (tmp_path / "mm.csv").write_text("\n".join(",".join(row) for row in [heading, *rows]))
    refused = socasadi("init", "arm.py", "--record", "mm.csv", cwd=tmp_path)
    assert refused.returncode == 1
    assert "a record whose outputs are in m" in refused.stdout
    assert "--anyway" in refused.stderr
    assert not (tmp_path / "runs").exists()
    assert socasadi("init", "arm.py", "--record", "mm.csv", "--anyway", cwd=tmp_path).returncode == 0


def test_a_campaign_starts_from_what_fits_the_record(tmp_path, recorded):
    (tmp_path / "arm.py").write_text(EXTERNAL.format(radius=0.05))
    done = socasadi("init", "arm.py", "--record", recorded, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    result = Result.open(tmp_path / "runs" / "arm")
    with Campaign.open(tmp_path / "runs" / "arm") as campaign:
        first = campaign.ask().theta
    assert first == pytest.approx(identify(result.study.mpc.model, read_probe(recorded, result.study)))
