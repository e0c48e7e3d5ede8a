"""Reach, the cost's own optimum, and robots that are known from a record or a data sheet."""

import numpy as np
import pytest
from feasibility_support import MODEL, study, verdicts
from scipy.optimize import lsq_linear

from socasadi import Circle, Cost, ExternalPlant, LinearMPC, Modal, Origin, Rod, SimulatedPlant, Study
from socasadi.campaign import RecordingError, fly, probe, read_probe
from socasadi.feasibility import SpecSheetError, check, check_record, read_spec_sheet
from socasadi.feasibility._optimum import optimum
from socasadi.feasibility._reach import ray
from socasadi.model import Record, StateSpace, identify

SHEET = """
length = 0.6
bending_stiffness = 0.636
mass_per_length = 2.83
cable_offset = 0.02
"""


def arm(model=MODEL, **settings):
    plant = ExternalPlant(sample_time=0.05, inputs=3, outputs=2, name="the arm")
    return Study(plant=plant, mpc=LinearMPC(model), task=Circle(**settings))


def test_one_cable_reaches_what_a_straight_cable_bends_the_rod_by():
    """kappa = F d / E I, with the stretch 1 - F / E A: 56.2 mm for 10 N."""
    found = check(study(input_bounds=((0, 0, 0), (10, 1e-9, 1e-9)), task=Circle(radius=0.01)), quick=True)
    assert found.picture is not None
    assert found.picture.reach[:, 0].max() == pytest.approx(0.056221, abs=1e-5)
    assert np.abs(found.picture.reach[:, 1]).max() < 1e-6


def test_no_pose_lies_outside_the_reach():
    rod, found = Rod.preset("paper"), check(study(), quick=True)
    corners = found.picture.reach
    for given in np.random.default_rng(0).uniform(-10, 10, (40, 3)):
        tip = rod.equilibrium(given).tip[1:]
        assert np.linalg.norm(tip) <= ray(corners, np.zeros(2), tip / np.linalg.norm(tip)) + 1e-4


@pytest.mark.parametrize("term", ["rate", "normalised", "literal"])
def test_no_other_inputs_cost_less_than_the_optimum(term):
    """Against the same least-squares problem written out and solved whole."""
    random, T = np.random.default_rng(1), 12
    A = np.array([[0.9, 0.2], [-0.3, 0.7]])
    system = StateSpace(A, random.normal(size=(2, 2)), random.normal(size=(1, 2)), random.normal(size=(1, 2)))
    reference, scale = random.normal(size=(T, 1)), np.array([2.0, 5.0])
    start, rest = np.array([0.3, -0.4]), np.array([1.0, 0.5])
    cost = Cost(Q=3.0, R=(0.2, 0.7), input_term=term)
    found = optimum(system, reference, cost, scale, start, rest)

    def flown(inputs):
        """Residuals of the cost for inputs (T, 2) as deviations."""
        x, before, rows = np.linalg.solve(np.eye(2) - A, system.B @ start), start, []
        for u, wanted in zip(inputs.reshape(T, 2), reference, strict=True):
            x = A @ x + system.B @ u
            rows.append(np.sqrt(3.0) * (system.C @ x + system.D @ u - wanted))
            weighed = {"rate": (u - before) / scale, "normalised": (u + rest) / scale, "literal": u + rest}[term]
            rows.append(np.sqrt([0.2, 0.7]) * weighed)
            before = u
        return np.concatenate(rows)

    constant = flown(np.zeros(2 * T))
    slope = np.column_stack([flown(unit) - constant for unit in np.eye(2 * T)])
    least = lsq_linear(slope, -constant)
    assert pytest.approx(2 * least.cost, rel=1e-9) == found.J
    assert found.input == pytest.approx(least.x.reshape(T, 2) + rest, abs=1e-6)


def test_a_robot_is_known_from_its_probing_record():
    """The same verdicts as from the rod itself, and the sensor's noise to a third."""
    plant = SimulatedPlant(Rod.preset("paper"), noise=1e-3)
    record = probe(plant, (-10, 10), seed=3)
    found = check(arm(), record=record)
    assert found.objections == ()
    noise = float(next(f for f in found.findings if f.name == "noise").says.split(" mm")[0])
    assert noise == pytest.approx(1.0, rel=0.34)
    period = next(f for f in found.findings if f.name == "sample time").says
    assert float(period.split(" Hz")[0].split()[-1]) == pytest.approx(0.7365, rel=0.05)
    assert verdicts(check(arm(radius=0.2), record=record))["reach"] == "infeasible"


@pytest.mark.parametrize(("part", "factor"), [("outputs", 1e3), ("outputs", 1e-3), ("inputs", 1e3), ("inputs", 1e-3)])
def test_a_record_in_another_unit_is_told_as_that_and_as_nothing_else(part, factor):
    record = probe(SimulatedPlant(Rod.preset("paper"), noise=1e-3), (-10, 10), seed=3, duration=5.0)
    y, u = (factor if part == name else 1.0 for name in ("outputs", "inputs"))
    (finding,) = check(arm(), record=Record(record.sample_time, u * record.tension, y * record.output)).findings
    assert (finding.name, finding.verdict) == ("record", "infeasible")
    assert f"whose {part} are in {'m' if part == 'outputs' else 'N'}" in finding.advice


@pytest.mark.parametrize(
    ("mistaken", "told"),
    [
        (lambda u, y: (u[:, [0, 2, 1]], y), "u1, u3, u2"),
        (lambda u, y: (u[:, [1, 2, 0]], y), "u3, u1, u2"),
        (lambda u, y: (-u, y), "sign of every input"),
        (lambda u, y: (u, y + np.array([0.03, 0.0])), "counted from where it rests"),
        pytest.param(lambda u, y: (u[4:], y[:-4]), "4 samples late", marks=pytest.mark.slow),
    ],
)
def test_what_people_get_wrong_in_a_record_is_named(mistaken, told):
    record = probe(SimulatedPlant(Rod.preset("paper"), noise=1e-3), (-10, 10), seed=3)
    u, y = mistaken(record.tension, record.output)
    (finding,) = check_record(arm(), Record(record.sample_time, u, y)).findings
    assert finding.verdict in ("doubtful", "infeasible")
    assert told in finding.says
    assert check_record(arm(), record).objections == ()


def test_a_record_in_which_a_cable_stands_still_is_told_so():
    record = probe(SimulatedPlant(Rod.preset("paper"), noise=1e-3), (-10, 10), seed=3, duration=5.0)
    (finding,) = check_record(arm(), Record(0.05, record.tension * [1, 1, 0], record.output)).findings
    assert "vary in 2 independent ways" in finding.says


def test_an_arm_that_its_cables_would_roll_up_is_a_wrong_unit(tmp_path):
    (sheet := tmp_path / "arm.toml").write_text(
        "length = 0.6\nbending_stiffness = 0.00064\nmass_per_length = 2.83\ncable_offset = 0.02\n"
    )
    found = check(arm(), plant=read_spec_sheet(sheet, 0.05))
    assert found.source == "the data sheet"
    (finding,) = found.findings
    assert finding.verdict == "infeasible"
    assert "N m2" in finding.advice


def test_a_record_is_read_from_csv(tmp_path):
    record = probe(SimulatedPlant(Rod.preset("paper")), (-10, 10), seed=3, duration=5.0)
    lines = ["t [s],y1 [m],y2 [m],u1 [N],u2 [N],u3 [N]"]
    for k, y in enumerate(record.output):
        u = record.tension[k] if k < len(record.tension) else ["", "", ""]
        lines.append(",".join(map(str, [0.05 * k, *y, *u])))
    file = tmp_path / "probe.csv"
    file.write_text("\n".join(lines))
    back = read_probe(file, arm())
    assert np.array_equal(back.output, record.output)
    assert np.array_equal(back.tension, record.tension)
    file.write_text("\n".join([*lines[:40], *lines[41:]]))
    with pytest.raises(RecordingError, match=r"line 41.*1 sample missing"):
        read_probe(file, arm())


def test_a_robot_is_known_from_its_data_sheet(tmp_path):
    """A sheet with the numbers of the preset "paper" is that rod."""
    (tmp_path / "arm.toml").write_text(SHEET)
    plant = read_spec_sheet(tmp_path / "arm.toml", 0.05)
    assert plant.rod.modes().frequency[0] == pytest.approx(0.7365, rel=0.01)
    tip = plant.rod.equilibrium([10.0, 0.0, 0.0]).tip
    assert tip[1] == pytest.approx(0.056221, rel=0.01)
    found = check(arm(), plant=plant)
    assert found.source == "the data sheet"
    assert found.objections == ()
    record = probe(SimulatedPlant(Rod.preset("paper")), (-10, 10), seed=3)
    assert check(arm(), plant=plant, record=record).objections == ()


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        (SHEET.replace("length = 0.6\n", ""), "lacks length"),
        (SHEET + "colour = 'red'", "'colour', which no data sheet has"),
        (SHEET.replace("0.02", "-0.02"), "cable_offset is -0.02"),
        (SHEET.replace("0.02", "'2 cm'"), "cable_offset is '2 cm'"),
        (SHEET.replace("length = 0.6", "length = 600"), "are both in m"),
        (SHEET + "poisson = 0.9", "poisson"),
        (SHEET + "gravity = 9.81", "gravity"),
        (SHEET + "cable_angles = ['up']", "cable_angles"),
        ("length: 3", "no TOML"),
    ],
)
def test_a_wrong_data_sheet_is_refused_in_a_sentence(tmp_path, text, fault):
    (tmp_path / "arm.toml").write_text(text)
    with pytest.raises(SpecSheetError, match=fault):
        read_spec_sheet(tmp_path / "arm.toml", 0.05)


def test_of_a_robot_that_nobody_knows_nothing_is_claimed():
    assert verdicts(check(arm(Modal()))) == {"robot": "unknown"}
    guessed = check(arm(radius=0.3))
    assert guessed.source == "the middle of theta's bounds"
    assert guessed.verdict == "doubtful"
    assert verdicts(guessed)["noise"] == "unknown"


def test_a_record_of_another_robot_is_refused():
    record = probe(SimulatedPlant(Rod.preset("paper"), sample_time=0.1), (-10, 10))
    with pytest.raises(ValueError, match=r"sampled every 0\.1 s, but the study every 0\.05 s"):
        check(arm(), record=record)


def test_the_start_is_judged_where_the_robot_is_known_from_a_model_alone():
    task = Origin(tip=(0.5, 0.0))
    plant = ExternalPlant(sample_time=0.05, inputs=3, outputs=2)
    assert verdicts(check(Study(plant=plant, mpc=LinearMPC(MODEL), task=task)))["start"] == "doubtful"


@pytest.mark.parametrize("task", [Circle(), pytest.param(Origin(), marks=pytest.mark.slow)])
def test_the_settled_error_is_what_the_identified_controller_flies_with(task):
    """The check's linear flight against the rod itself, 20 s, to a quarter."""
    asked = study(task=task)
    says = next(finding.says for finding in check(asked).findings if finding.name == "settled error")
    theta = identify(MODEL, probe(asked.plant, (-10, 10), seed=2))
    episode = fly(asked.plant, asked.mpc.controller(theta), task, seed=0, time_limit=60)
    flown = 1e3 * asked.cost.score(episode, asked.mpc.input_scale).rmse
    assert float(says.removeprefix("about ").split(" mm")[0]) == pytest.approx(flown, rel=0.25)
