"""Bad input is one clear sentence; a rod is plain data that can be copied, stored and sent to other processes."""

import copy
import pickle
from dataclasses import replace

import casadi as ca
import numpy as np
import pytest

from socasadi.rod import Cable, Material, Rod, Section, Strain

PAPER = Rod.preset("paper")


@pytest.mark.parametrize(
    ("build", "message"),
    [
        (lambda: Rod.preset("papper"), "'papper'; there are paper, hanging, paper_literal"),
        (lambda: replace(PAPER, length=-0.6), "length is -0.6"),
        (lambda: replace(PAPER, length="0.6"), "length is '0.6'"),
        (lambda: replace(PAPER, gravity=(9.81, 0)), r"gravity has shape \(2,\)"),
        (lambda: replace(PAPER, gravity=(9.81, 0, float("nan"))), "gravity is .*nan.* finite"),
        (lambda: replace(PAPER, quadrature_points=2), "quadrature_points is 2, .* at least 3"),
        (lambda: Material(-1e6, 0.5, 1000), "young is -1000000.0"),
        (lambda: Material(1e6, 0.51, 1000), "poisson is 0.51"),
        (lambda: Material(1e6, 0.5, 0), "density is 0"),
        (lambda: Material(1e6, 0.5, 1000, float("inf")), "damping is inf"),
        (lambda: Section.circle(0.0), "radius is 0.0"),
        (lambda: Section(1.0, 1.0, 1.0, torsion_constant=0.0), "torsion_constant is 0.0"),
        (lambda: Cable((float("nan"), 0.0)), r"route is \[nan, 0.0\]"),
        (lambda: Material(1e6, "0.5", 1000), "poisson is '0.5'"),
        (lambda: Strain(), "no strain is free"),
        (lambda: Strain(bending_y=-1), "bending_y is -1"),
        (lambda: Strain(bending_y=1.5), "bending_y is 1.5"),
        (lambda: Strain(bending_y=1, rest=(0, 0, 0, 0, 0, 0)), "rest stretch is 0.0"),
        (lambda: PAPER.equilibrium(tension=[1, 2]), r"tension has shape \(2,\).*\(3,\)"),
        (lambda: PAPER.equilibrium(tension=[1, 2, float("nan")]), "tension is .*finite"),
        (lambda: PAPER.equilibrium(tip_force=1.0), "tip_force is 1.0, but must be 3 numbers"),
        (lambda: PAPER.equilibrium_at((0.0, 0.0, 0.0)), r"tip has shape \(3,\)"),
        (lambda: PAPER.equilibrium_at((0.0, 0.0), (10, -10)), r"tension_bounds is \(10, -10\)"),
        (lambda: PAPER.equilibrium_at((0.0, 0.0), (0, float("nan"))), "tension_bounds is"),
        (lambda: PAPER.equilibrium_at((0.0, 0.0), 10), "tension_bounds is 10"),
        (lambda: PAPER.step(0.0), "sample_time is 0.0"),
        (lambda: PAPER.step(0.05, substep=-1), "substep is -1"),
        (lambda: PAPER.linearise(sample_time=float("nan")), "sample_time is nan"),
        (lambda: PAPER.centreline(np.zeros(3)), r"q has shape \(3,\)"),
    ],
)
def test_bad_input_is_one_sentence_that_names_it(build, message):
    with pytest.raises(ValueError, match=message) as caught:
        build()
    assert "\n" not in str(caught.value)


def test_a_cable_outside_the_section_is_warned_of():
    with pytest.warns(UserWarning, match=r"cable 0 runs at \(y, z\) = \(0.04, 0\) m at s = 0 m, outside the section"):
        replace(PAPER, cables=(Cable((0.04, 0.0)),))


def test_a_rod_is_plain_hashable_data():
    assert Rod.preset("paper") == PAPER
    assert hash(Rod.preset("paper")) == hash(PAPER)


def test_a_rod_with_functions_can_be_pickled_and_copied():
    before = PAPER.equilibrium([3.0, 0.0, 0.0]).tip
    for twin in (pickle.loads(pickle.dumps(PAPER)), copy.deepcopy(PAPER)):
        assert twin == PAPER
        assert np.array_equal(twin.equilibrium([3.0, 0.0, 0.0]).tip, before)


def test_functions_take_symbols_and_any_arc_length():
    q, s = ca.MX.sym("q", PAPER.dof), ca.MX.sym("s")
    pose = ca.Function("pose", [q, s], [PAPER.pose(q, s)])
    bent = PAPER.equilibrium([10.0, 0.0, 0.0])
    assert np.allclose(pose(bent.q, 0.0).full(), np.eye(4), atol=1e-15)
    assert np.allclose(pose(bent.q, 0.6).full()[:3, 3], bent.tip, atol=1e-15)
    curvature = bent.q[4 + 0]
    midway = pose(bent.q, 0.3).full()
    assert np.arctan2(midway[1, 0], midway[0, 0]) == pytest.approx(0.3 * curvature, abs=1e-12)
    assert np.allclose(bent.centreline(3)[1], midway[:3, 3], atol=1e-15)


def test_a_rod_without_cables_rests_and_vibrates():
    bare = replace(PAPER, cables=(), gravity=(0.0, 0.0, -9.81))
    assert bare.equilibrium().tip[2] < -0.1
    assert bare.rhs(np.zeros(2 * bare.dof), np.zeros(0)).shape == (2 * bare.dof, 1)


def test_without_a_compiler_the_step_is_interpreted_with_the_same_result(monkeypatch):
    x, tension = np.zeros(2 * PAPER.dof), [5.0, 0.0, 0.0]
    machine = PAPER.step(0.05)(x, tension, np.zeros(3)).full()
    monkeypatch.setenv("CC", "no-such-compiler")
    monkeypatch.setattr("socasadi.codegen._compile._warn_interpreted", lambda: None)
    interpreted = copy.deepcopy(PAPER).step(0.05)(x, tension, np.zeros(3)).full()
    assert np.allclose(interpreted, machine, rtol=1e-10, atol=1e-12)


def test_the_parts_of_a_rod_have_their_types():
    with pytest.raises(TypeError, match=r"section is 0\.03, but must be a Section"):
        replace(PAPER, section=0.03)
