"""Every fault that a study can have is named, and a sound study has none."""

from dataclasses import replace

import numpy as np
import pytest
from feasibility_support import MODEL, study, verdicts

from socasadi import Camera, Circle, Cost, LaserSpot, Modal, Origin, Pulse, Rod, SimulatedPlant
from socasadi.codegen import c_compiler
from socasadi.feasibility import check
from socasadi.rod import Cable, Chamber, Material, PointLoad, Section, Strain, cables_around

PAPER = Rod.preset("paper")
WAND = Rod(
    0.6,
    Section.circle(0.012),
    Material(1e6, 0.5, 1000.0, 1.1e4),
    Strain(bending_y=2, bending_z=2, stretch=0),
    cables_around(3, 0.01),
    gravity=(-9.81, 0.0, 0.0),
)
"""Stands upright, and is too slender to."""
STIFF_MODEL = MODEL.with_bounds(
    [(20.0, 40.0) if entry.unit == "rad/s" else (entry.lower, entry.upper) for entry in MODEL.entries]
)
TURNED = Modal.from_spec(
    length=0.6, bending_stiffness=0.64, mass_per_length=2.8, cable_offset=0.02, cable_angles=(180.0, 300.0, 60.0)
)

BROKEN = {
    "a circle beyond reach": (
        lambda: study(task=Circle(radius=0.12), output_bounds=None),
        "reach",
        "infeasible",
        "96.9",
    ),
    "millimetres for metres": (lambda: study(task=Circle(radius=50.0), output_bounds=None), "reach", "infeasible", ""),
    "cables that only pull": (lambda: study(input_bounds=(0, 8)), "reach", "infeasible", ""),
    "bounds within the circle": (lambda: study(output_bounds=(-0.04, 0.04)), "output bounds", "infeasible", "10 mm"),
    "R on newtons": (lambda: study(cost=Cost(input_term="literal")), "cost weights", "infeasible", "newtons"),
    "R on newtons in the MPC": (lambda: study(input_term="literal"), "MPC weights", "infeasible", "newtons"),
    "two samples a period": (lambda: study(sample_time=0.5), "sample time", "infeasible", "0.736 Hz"),
    "a short horizon alone": (lambda: study(terminal=None), "horizon", "doubtful", "0.37"),
    "a noisy sensor": (lambda: study(noise=0.03, output_bounds=None), "noise", "infeasible", "30 mm"),
    "an arm that buckles": (lambda: study(rod=WAND, task=Circle(radius=0.01)), "gravity", "infeasible", "0.13"),
    "a model too stiff": (lambda: study(model=STIFF_MODEL), "model", "infeasible", "outside"),
    "cables on the other side": (lambda: study(model=TURNED), "model", "infeasible", "outside"),
    "two turns a second": (lambda: study(task=Circle(period=0.5)), "speed", "infeasible", ""),
    "a push beyond the bounds": (
        lambda: study(task=Circle(pulse=Pulse(time=10.0, duration=2.0, force=(0.0, 0.8, 0.0)))),
        "pulse",
        "doubtful",
        "50 mm away",
    ),
    "a start out of reach": (lambda: study(task=Origin(tip=(0.3, 0.0))), "start", "infeasible", "188 mm"),
}
if c_compiler():
    BROKEN["weights too far apart"] = (lambda: study(slack_weight=1e9), "single precision", "doubtful", "1e+09")


@pytest.mark.parametrize("fault", BROKEN)
def test_a_study_broken_in_one_way_is_told_that_way(fault):
    made, name, verdict, number = BROKEN[fault]
    found = check(made(), quick=name not in ("model", "single precision"))
    first = found.objections[0]
    assert (first.name, first.verdict) == (name, verdict)
    assert number in first.says
    assert first.advice
    assert [finding.name for finding in found.objections if finding.verdict == "infeasible"] in ([name], [])


@pytest.mark.parametrize(
    "sound",
    [
        lambda: study(),
        lambda: study(task=Origin()),
        lambda: study(rod=Rod.preset("hanging"), task=Circle(radius=0.03)),
        lambda: study(model=Modal()),
        lambda: study(plant=SimulatedPlant(PAPER, output=LaserSpot(1.0))),
    ],
)
def test_a_sound_study_has_nothing_against_it(sound):
    found = check(sound())
    assert found.objections == ()
    assert found.verdict == "ok"


def test_the_papers_table_taken_literally_is_infeasible_for_three_reasons():
    literal = study(rod=Rod.preset("paper_literal"), noise=0.01, cost=Cost(input_term="literal"), input_term="literal")
    found = {finding.name: finding for finding in check(literal, quick=True).findings}
    # Three cables move the tip by 4.6 mm, one by 2.3: not by 50.
    assert found["reach"].verdict == "infeasible"
    assert "4.59 mm" in found["reach"].says
    assert "2.29 mm" in found["pulling"].says
    # The cost's own optimum is not to move.
    assert found["cost weights"].verdict == "infeasible"
    assert "not to move is cheap" in found["cost weights"].says
    # The noise is more than the reach.
    assert found["noise"].verdict == "infeasible"
    assert "more than the 4.59 mm" in found["noise"].says


def test_an_arm_that_hangs_sideways_is_told_where_it_rests():
    found = verdicts(check(study(rod=replace(PAPER, gravity=(0.0, 0.0, -9.81))), quick=True))
    assert found["reach"] == "infeasible"
    assert found["output bounds"] == "doubtful"


def test_gravity_that_helps_and_gravity_that_hurts():
    """The paper's arm upright: w L^3 / (E I) = 9.4, and a cantilever buckles at 7.8373 (Greenhill 1881)."""
    upright = replace(PAPER, gravity=(-9.81, 0.0, 0.0))
    load = 1000.0 * np.pi * 0.03**2 * 9.81 * 0.6**3 / (1e6 * np.pi * 0.03**4 / 4)
    (finding,) = [f for f in check(study(rod=upright), quick=True).findings if f.name == "gravity"]
    assert finding.verdict == "infeasible"
    times = float(finding.says.split("up to ")[1].split(" times")[0])
    assert times == pytest.approx(7.8373 / load, rel=0.02)
    assert verdicts(check(study(rod=Rod.preset("hanging")), quick=True))["gravity"] == "ok"


def test_the_advice_on_R_is_enough():
    trapped = study(cost=Cost(input_term="literal"))
    (finding,) = check(trapped, quick=True).objections
    times = float(finding.advice.split("R ")[-1].split(" times")[0].replace(",", ""))
    mended = study(cost=Cost(R=1 / (1.02 * times), input_term="literal"))
    assert verdicts(check(mended, quick=True))["cost weights"] == "ok"
    barely = study(cost=Cost(R=2 / times, input_term="literal"))
    assert verdicts(check(barely, quick=True))["cost weights"] == "doubtful"


def test_robots_that_are_no_tendon_arms_are_judged_in_their_own_units():
    """Winches, chambers and a camera on the same rod: all can do a small circle, and none is told of pulling."""
    around = [(0.02 * np.cos(a), 0.02 * np.sin(a)) for a in np.radians([0, 120, 240])]
    winches = replace(PAPER, cables=tuple(Cable(at, drive="length", stiffness=2e4) for at in around))
    chambers = replace(PAPER, cables=tuple(Chamber(at, area=1e-4) for at in around))
    small = Circle(radius=0.02)
    for rod, bounds in ((winches, (0.58, 0.62)), (chambers, (0, 1e5))):
        found = verdicts(check(study(rod=rod, input_bounds=bounds, task=small), quick=True))
        assert found["reach"] == found["effort"] == found["speed"] == "ok"
        assert "pulling" not in found
    camera = SimulatedPlant(PAPER, output=Camera((1.6, 0, 0), (0.6, 0, 0), focal_length=500), noise=0.5)
    seen = check(study(plant=camera, output_bounds=(-60, 60), task=Circle(radius=20.0)), quick=True)
    assert "47.8 to 55.4 px" in next(finding.says for finding in seen.findings if finding.name == "reach")


def test_a_load_buckles_an_arm_as_its_weight_does_and_a_bent_one_is_told_no_factor():
    """Euler's load of a clamped column is pi^2 E I / (4 L^2) = 4.36 N."""

    def of_gravity(rod):
        return next(
            f for f in check(study(rod=rod, task=Circle(radius=0.01)), quick=True).findings if f.name == "gravity"
        )

    assert of_gravity(replace(PAPER, loads=(PointLoad(force=(-6.0, 0.0, 0.0)),))).verdict == "infeasible"
    pressed = of_gravity(replace(PAPER, loads=(PointLoad(force=(-2.0, 0.0, 0.0)),)))
    times = float(pressed.says.split("buckles at ")[1].split(" times")[0])
    assert times == pytest.approx(np.pi**2 * 0.6362 / (4 * 0.6**2) / 2, rel=0.02)
    sideways = of_gravity(replace(PAPER, gravity=(0.0, 0.0, -2.0)))
    assert "138 mm off the axis" in sideways.says
    assert "buckles" not in sideways.says


def test_noise_counts_by_what_it_does_to_J_not_by_its_floor():
    """A constant harms no search: a small circle under 1 mm is sound, and so is the way to the origin."""
    assert verdicts(check(study(task=Circle(radius=0.012)), quick=True))["noise"] == "ok"
    assert verdicts(check(study(task=Origin()), quick=True))["noise"] == "ok"


def test_rates_that_are_too_slow_are_named():
    slow = check(study(rate_bounds=(-0.01, 0.01)), quick=True).objections[0]
    assert (slow.name, slow.verdict) == ("speed", "infeasible")
    assert "rate_bounds" in slow.advice


def test_a_cable_that_may_never_be_let_go_is_named():
    slack = check(study(rate_bounds=(0.0, 20.0)), quick=True).objections[0]
    assert (slack.name, slack.verdict) == ("speed", "infeasible")


def test_a_lasting_push_bends_the_arm_to_twice_where_it_would_hold_it():
    """A step of force P swings a lightly damped cantilever to nearly twice its static deflection P L^3 / (3 E I)."""
    pushed = study(task=Circle(radius=0.02, pulse=Pulse(time=5.0, duration=2.0, force=(0.0, 0.2, 0.0))))
    (finding,) = [f for f in check(pushed, quick=True).findings if f.name == "pulse"]
    static = 0.2 * 0.6**3 / (3 * 1e6 * np.pi * 0.03**4 / 4)
    told = 1e-3 * float(finding.says.split(" mm")[0].split()[-1])
    assert finding.verdict == "ok"
    assert told == pytest.approx((1 + np.exp(-np.pi * 0.08)) * static, rel=0.05)


def test_a_pulse_is_as_long_as_the_samples_that_begin_in_it_and_touches_at_least_one():
    def told(**pulse):
        found = check(study(task=Circle(pulse=Pulse(force=(0.0, 0.2, 0.0), **pulse))), quick=True)
        return next(f.says for f in found.findings if f.name == "pulse").split("pushes")[1]

    assert told(time=5.0, duration=0.05) == told(time=5.02, duration=0.04)
    for pulse in (Pulse(5.013, 0.02, (0, 1, 0)), Pulse(50.0, 1.0, (0, 1, 0))):
        with pytest.raises(ValueError, match="pushes in no sample"):
            study(task=Circle(pulse=pulse))
    thrown = check(study(task=Circle(pulse=Pulse(5.0, 1.0, (0, 100, 0)))), quick=True)
    assert thrown.objections[0].name == "pulse"
    assert thrown.objections[0].verdict == "infeasible"


def test_one_cable_reaches_along_a_line():
    one = study(
        rod=replace(PAPER, cables=cables_around(1, 0.02)), model=Modal(axes=2, inputs=1), task=Circle(radius=0.02)
    )
    (finding,) = [f for f in check(one, quick=True).findings if f.name == "reach"]
    assert finding.verdict == "infeasible"
    assert "-56.6 to 56.2 mm" in finding.says


def test_nothing_is_told_of_a_speed_that_the_jump_at_the_start_hides():
    assert "speed" not in verdicts(check(study(task=Circle(duration=1.0)), quick=True))


def test_a_mode_that_does_not_swing_is_sampled_by_its_time_constant():
    honey = replace(PAPER, material=Material(young=1e6, poisson=0.5, density=1000.0, damping=2.2e5))
    assert verdicts(check(study(rod=honey, sample_time=2.0), quick=True))["sample time"] == "infeasible"


def test_weights_may_be_matrices_and_those_of_the_mpc_are_told_only_where_they_differ():
    matrices = Cost(Q=np.diag([1e3, 1e3]), R=np.eye(3))
    assert "MPC weights" not in verdicts(check(study(cost=matrices, Q=np.diag([1e3, 1e3]), R=np.eye(3)), quick=True))
    assert "MPC weights" in verdicts(check(study(cost=matrices, Q=np.diag([1e3, 2e3])), quick=True))
