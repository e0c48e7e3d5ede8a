"""Bad input is one clear sentence; a rod is plain data that can be copied, stored and sent to other processes."""

import copy
import pickle
from dataclasses import replace

import casadi as ca
import numpy as np
import pytest

from socasadi.rod import (
    BSpline,
    Cable,
    Chamber,
    Converging,
    DistributedLoad,
    Division,
    Drag,
    Helix,
    Legendre,
    Material,
    Payload,
    PointLoad,
    Rod,
    Section,
    Strain,
    Taper,
    UserBasis,
    cables_around,
    piecewise_linear,
    pointing,
)

PAPER = Rod.preset("paper")
NAN = float("nan")
SILICONE, CIRCLE, BEND = PAPER.divisions[0].material, PAPER.divisions[0].section, Strain(bending_z=1)
SYMBOL = ca.SX.sym("k")
TWO = Rod(divisions=(Division(0.3, CIRCLE, SILICONE, BEND),) * 2)
FREE = replace(PAPER, material=Material(SYMBOL, 0.5, 1000), parameters=(SYMBOL,))


def division(**changes):
    return Division(**{"length": 0.3, "section": CIRCLE, "material": SILICONE, "strain": BEND} | changes)


def bent(*functions, **options):
    return division(strain=Strain(bending_z=UserBasis(functions, **options)))


ROD = [
    (lambda: Rod.preset("papper"), "'papper'; there are paper, hanging, paper_literal"),
    (lambda: Rod(), "length, section, material, strain not given"),
    (lambda: Rod(0.6, CIRCLE, strain=BEND), "material not given"),
    (lambda: replace(PAPER, length=-0.6), "length is -0.6"),
    (lambda: replace(PAPER, length="0.6"), "length is '0.6'"),
    (lambda: replace(PAPER, length=True), "length is True"),
    (lambda: replace(PAPER, length=SYMBOL), "length is the expression k"),
    (lambda: replace(TWO, length=0.5), "length is 0.5 m beside 2 divisions"),
    (lambda: replace(PAPER, divisions=5), "divisions is 5"),
    (lambda: replace(PAPER, divisions=[1]), r"divisions\[0\] is 1, but must be a Division"),
    (lambda: replace(PAPER, cables=None), "cables is None"),
    (lambda: replace(PAPER, cables=[(0.02, 0)]), r"cables\[0\] is \(0.02, 0\), but must be a Cable or a Chamber"),
    (lambda: replace(PAPER, payloads=[0.05]), r"payloads\[0\] is 0.05, but must be a Payload"),
    (lambda: replace(PAPER, loads=[Drag()]), r"loads\[0\] is Drag.*, but must be a PointLoad or a DistributedLoad"),
    (lambda: replace(PAPER, drag=1.0), "drag is 1.0, but must be a Drag or None"),
    (lambda: replace(PAPER, gravity=(9.81, 0)), r"gravity has shape \(2,\)"),
    (lambda: replace(PAPER, gravity=(9.81, 0, NAN)), "gravity is .*nan.* finite"),
    (lambda: replace(PAPER, gravity="down"), "gravity is 'down', but must be 3 numbers"),
    (lambda: replace(PAPER, gravity=None), "gravity is None, but must be 3 numbers"),
    (lambda: replace(PAPER, base_rotation=2 * np.eye(3)), "base_rotation is .* rotation matrix"),
    (lambda: replace(PAPER, base_rotation=np.diag([1, 1, -1])), "base_rotation is .* right-handed"),
    (lambda: replace(PAPER, base_rotation=(1, 0, 0)), r"base_rotation is \(1, 0, 0\)"),
    (lambda: replace(PAPER, base_position=(0, 0)), r"base_position has shape \(2,\)"),
    (lambda: replace(PAPER, base_position=(0, 0, SYMBOL), parameters=(SYMBOL,)), "base_position"),
    (lambda: replace(PAPER, quadrature_points=2), "quadrature_points is 2, .* at least 3"),
    (lambda: replace(PAPER, quadrature_points=6.5), "quadrature_points is 6.5"),
    (lambda: replace(PAPER, parameters=None), "parameters is None"),
    (lambda: replace(PAPER, parameters=[1.0]), r"parameters.* 1(\.0)?,"),
    (lambda: replace(PAPER, parameters=(2 * SYMBOL,)), "parameters holds"),
    (lambda: replace(PAPER, parameters=(SYMBOL, SYMBOL)), "parameters .*k.* twice"),
    (lambda: replace(PAPER, parameters=ca.MX.sym("m")), "parameters"),
    (lambda: replace(PAPER, gravity=(0, 0, SYMBOL)), "the symbol k is used but not among parameters"),
    (lambda: FREE.at([1.0, 2.0]), r"values has shape \(2,\)"),
    (lambda: FREE.at([NAN]), "values is .* finite"),
    (lambda: FREE.at("a"), "values is 'a'"),
    (lambda: replace(PAPER, payloads=(Payload(0.1, s=0.7),)), r"s of payloads\[0\] is 0.7 m, beyond the tip at 0.6 m"),
    (lambda: replace(PAPER, loads=(PointLoad(s=0.7),)), r"s of loads\[0\] is 0.7 m, beyond the tip"),
    (lambda: replace(PAPER, loads=(DistributedLoad(end=0.7),)), r"end of loads\[0\] is 0.7 m"),
    (lambda: replace(PAPER, cables=(Cable((0, 0), start=0.7),)), r"start of cables\[0\] is 0.7 m"),
    (lambda: replace(PAPER, cables=(Cable((0, 0), end=0.7),)), r"end of cables\[0\] is 0.7 m"),
    (lambda: replace(PAPER, cables=(Cable((0, 0), start=0.6),)), r"start of cables\[0\] is 0.6 m"),
]
PARTS = [
    (lambda: Material(-1e6, 0.5, 1000), "young is -1000000.0"),
    (lambda: Material("1e6", 0.5, 1000), "young is '1e6'"),
    (lambda: Material(None, 0.5, 1000), "young is None"),
    (lambda: Material(np.array([1e6, 1e6]), 0.5, 1000), "young is array"),
    (lambda: Material(ca.MX.sym("E"), 0.5, 1000), "young is MX"),
    (lambda: Material(1e6, 0.51, 1000), "poisson is 0.51, but must be above -1 and at most 0.5"),
    (lambda: Material(1e6, -1, 1000), "poisson is -1"),
    (lambda: Material(1e6, "0.5", 1000), "poisson is '0.5'"),
    (lambda: Material(1e6, 0.5, 0), "density is 0"),
    (lambda: Material(1e6, 0.5, 1000, float("inf")), "damping is inf"),
    (lambda: Material(1e6, 0.5, 1000, -1), "damping is -1"),
    (lambda: Section.circle(0.0), "radius is 0.0"),
    (lambda: Section.tube(0.02, 0.03), "inner_radius is 0.03 m, but must be less than the radius, 0.02 m"),
    (lambda: Section.ellipse(0.02, -1), "half_width_z is -1"),
    (lambda: Section.rectangle(0, 1), "width_y is 0"),
    (lambda: Section(1.0, 1.0, 1.0, torsion_constant=0.0), "torsion_constant is 0.0"),
    (lambda: Section(1.0, 1.0, 1.0, half_widths=(1, -1)), "half_width_z is -1"),
    (lambda: Section(1.0, 1.0, 1.0, outline="hexagon"), "outline is 'hexagon'"),
    (lambda: Section(1.0, 1.0, 1.0, shear_correction=0), "shear_correction is 0"),
    (lambda: Taper("hexagon", 1, 1), "shape is 'hexagon', but must be one of circle"),
    (lambda: Taper("circle", 0.03, -0.01), "radius is -0.01"),
    (lambda: Taper("tube", 0.03, 0.01), r"base has shape \(1,\), but must have shape \(2,\)"),
    (lambda: Strain(), "no strain is free"),
    (lambda: Strain(bending_y=-1), "bending_y is -1"),
    (lambda: Strain(bending_y=1.5), "bending_y is 1.5"),
    (lambda: Strain(bending_y=True), "bending_y is True"),
    (lambda: Strain(bending_y=Legendre), "bending_y is <class"),
    (lambda: Strain(bending_y=1, rest=(0, 0, 0, 0, 0, 0)), "rest stretch is 0.0"),
    (lambda: Strain(bending_y=1, rest=(0, 0, 0)), r"rest has shape \(3,\)"),
    (lambda: Strain(bending_y=1, rest=lambda x: (0, 0, 0)), r"rest\(x\) has shape \(3,\)"),
    (lambda: Strain(bending_y=1, rest=lambda x: (0, 0, 0, -x, 0, 0)), "rest stretch is -?0.0"),
    (lambda: Strain(bending_y=1, rest=lambda x: 1 / 0), "Strain: rest .*division by zero"),
    (lambda: Legendre(-1), "order is -1"),
    (lambda: BSpline(-1, 2), "degree is -1"),
    (lambda: BSpline(1, 0), "pieces is 0"),
    (lambda: BSpline(1, (0.5, 0.2)), r"pieces is \(0.5, 0.2\)"),
    (lambda: BSpline(1, (0.5, "a")), "BSpline: .*'a'"),
    (lambda: UserBasis(()), "there are no functions"),
    (lambda: UserBasis(5), "UserBasis: .*5"),
    (lambda: UserBasis((lambda x: SYMBOL * x,)), r"function 0 gives \(k\*x\), but must give one expression of x alone"),
    (lambda: UserBasis((lambda x: 1 / 0,)), "function 0 fails on a CasADi symbol: division by zero"),
    (lambda: UserBasis((lambda x: x,), degree=-1), "degree is -1"),
    (lambda: UserBasis((lambda x: x,), breaks=(0.5, 0.2)), r"breaks is \(0.5, 0.2\)"),
    (lambda: UserBasis((lambda x: x,), breaks=0.5), "UserBasis: breaks is 0.5"),
    (lambda: bent(lambda x: x, lambda x: 2 * x), "the 2 basis functions of bending_z are linearly dependent"),
    (lambda: bent(lambda x: NAN * x), "basis of bending_z is not finite"),
    (
        lambda: division(strain=Strain(bending_z=4), quadrature_points=4),
        "quadrature_points is 4, .* at least 5 .* bending_z",
    ),
    (
        lambda: division(strain=Strain(shear_y=piecewise_linear(4)), quadrature_points=1),
        "at least 2 for the 5 functions",
    ),
    (lambda: division(stiffness=5), "stiffness is 5, but must be 6 x 6 numbers"),
    (lambda: division(stiffness=np.eye(5)), r"stiffness has shape \(5, 5\)"),
    (lambda: division(stiffness=(0, 1, 1, 1, 1, 1)), "stiffness is .* positive definite"),
    (lambda: division(stiffness=np.triu(np.ones((6, 6)))), "stiffness is .* symmetric"),
    (lambda: division(stiffness=lambda x: None), "stiffness is None"),
    (lambda: division(damping=-np.ones(6)), "damping is .* positive semidefinite"),
    (lambda: division(section=lambda x: 5), "section is 5 at x = 0.0, but must be a Section"),
    (lambda: division(section=lambda x: Section.circle(0.03 - 0.05 * x)), "radius is -0.02"),
    (lambda: division(section=0.03), r"section is 0\.03, but must be a Section"),
    (lambda: division(material=1e6), "material is 1000000.0, but must be a Material"),
    (lambda: division(strain=2), "strain is 2, but must be a Strain"),
    (lambda: division(length=0), "length is 0"),
]
THINGS = [
    (lambda: Cable((NAN, 0.0)), r"route is \[nan, 0.0\]"),
    (lambda: Cable((0.02,)), r"route has shape \(1,\)"),
    (lambda: Cable(None), "route is None"),
    (lambda: Cable(lambda s: 0.02), "the route does not give two expressions for a CasADi symbol"),
    (lambda: Cable(lambda s: (float(s), 0)), "the route does not give two expressions for a CasADi symbol"),
    (lambda: Cable((0.02, 0), start=-1), "start is -1"),
    (lambda: Cable((0.02, 0), start=0.3, end=0.2), "end is 0.2 m, but must be beyond the start, 0.3 m"),
    (lambda: Cable((0.02, 0), end="a"), "end is 'a'"),
    (lambda: Cable((0.02, 0), friction=-1), "friction is -1"),
    (lambda: Cable((0.02, 0), drive="force"), "drive is 'force', but must be 'tension' or 'length'"),
    (lambda: Cable((0.02, 0), drive="length"), "stiffness is None"),
    (lambda: Cable((0.02, 0), stiffness=1e4), "stiffness is 10000.0, but a cable driven by tension has none"),
    (lambda: Chamber((0.02, 0), 0), "area is 0"),
    (lambda: Chamber((0.02, 0), 1e-4, end=-1), "end is -1 m"),
    (lambda: Helix(0.02, 0), "pitch is 0 m"),
    (lambda: Helix(NAN, 0.1), "radius is nan"),
    (lambda: Converging((0.02, 0), (0.01, 0), 0), "length is 0"),
    (lambda: Converging(0.02, (0.01, 0), 0.6), "base is 0.02, but must be 2 numbers"),
    (lambda: cables_around(2.5, 0.02), "count is 2.5"),
    (lambda: cables_around(-1, 0.02), "count is -1"),
    (lambda: cables_around(3, "a"), "offset is 'a'"),
    (lambda: cables_around(3, NAN), "nan"),
    (lambda: Payload(-1), "mass is -1"),
    (lambda: Payload(0.1, s=0), "s is 0"),
    (lambda: Payload(0.1, s="a"), "s is 'a'"),
    (lambda: Payload(0.1, inertia=(1, 2)), r"inertia has shape \(2,\)"),
    (lambda: Payload(0.1, inertia=(-1, 2, 3)), "inertia is .* positive semidefinite"),
    (lambda: Payload(0.1, inertia=[[1, 2, 0], [0, 1, 0], [0, 0, 1]]), "inertia is .* symmetric"),
    (lambda: Payload(0.1, offset=0.1), "offset is 0.1, but must be 3 numbers"),
    (lambda: PointLoad(5), "force is 5"),
    (lambda: PointLoad((0, 0, NAN)), "force is .* finite"),
    (lambda: PointLoad(moment=(1, 2)), r"moment has shape \(2,\)"),
    (lambda: PointLoad(s=-1), "s is -1"),
    (lambda: DistributedLoad(5), "force is 5"),
    (lambda: DistributedLoad((0, 1, 0), start=0.5, end=0.2), "end is 0.2 m, but must be beyond the start"),
    (lambda: replace(PAPER, loads=(DistributedLoad(lambda s: 5),)).equilibrium(), r"DistributedLoad: force\(.*5"),
    (lambda: Drag(1.0), "linear is 1.0, but must be 2 numbers"),
    (lambda: Drag((-1, 0)), r"linear\[0\] is -1"),
    (lambda: Drag(quadratic=(0, NAN)), "quadratic is .* finite"),
    (lambda: Drag(angular=(0, -2)), r"angular\[1\] is -2"),
]
CALLS = [
    (lambda: PAPER.equilibrium(tension=[1, 2]), r"tension has shape \(2,\).*\(3,\)"),
    (lambda: PAPER.equilibrium(tension=[1, 2, NAN]), "tension is .*finite"),
    (lambda: PAPER.equilibrium(tension="pull"), "tension is 'pull'"),
    (lambda: PAPER.equilibrium(tip_force=1.0), "tip_force is 1.0, but must be 3 numbers"),
    (lambda: PAPER.equilibrium(follower_moment=(1, 2)), r"follower_moment has shape \(2,\)"),
    (lambda: PAPER.equilibrium([1, 2, 3], lengths=[0.6] * 3), "both tension and lengths are given"),
    (lambda: PAPER.equilibrium(lengths=[0.6, 0.6]), r"lengths has shape \(2,\)"),
    (lambda: PAPER.equilibrium_at((0.0, 0.0, 0.0)), r"tip has shape \(3,\)"),
    (lambda: PAPER.equilibrium_at((0.0, 0.0), (10, -10)), r"tension_bounds is \(10, -10\)"),
    (lambda: PAPER.equilibrium_at((0.0, 0.0), (0, NAN)), "tension_bounds is"),
    (lambda: PAPER.equilibrium_at((0.0, 0.0), 10), "tension_bounds is 10"),
    (lambda: PAPER.resting(([0, 0], 1)), r"tension_bounds is \(\[0, 0\], 1\)"),
    (lambda: PAPER.step(0.0), "sample_time is 0.0"),
    (lambda: PAPER.step(None), "sample_time is None"),
    (lambda: PAPER.step(SYMBOL), "sample_time is"),
    (lambda: PAPER.step(0.05, substep=-1), "substep is -1"),
    (lambda: PAPER.step(0.05, substep=NAN), "substep is nan"),
    (lambda: PAPER.reference_step(-1.0), "sample_time is -1.0"),
    (lambda: PAPER.reference_step(0.05, "euler"), "method is 'euler', but must be 'cvodes' or 'collocation'"),
    (lambda: PAPER.reference_step(0.05, "collocation", 0), "elements is 0"),
    (lambda: PAPER.linearise(sample_time=NAN), "sample_time is nan"),
    (lambda: PAPER.linearise(output=PAPER.tip), "output is tip.*must be a CasADi Function of the state"),
    (lambda: PAPER.linearise(output=5), "output is 5"),
    (lambda: PAPER.linearise(TWO.equilibrium()), "equilibrium"),
    (lambda: PAPER.linearise(5), "equilibrium is 5"),
    (lambda: PAPER.modes(TWO.equilibrium()), "equilibrium"),
    (lambda: PAPER.centreline(np.zeros(3)), r"q has shape \(3,\)"),
    (lambda: PAPER.frames("bent"), "q is 'bent'"),
    (lambda: pointing((0, 0, 0)), "points nowhere"),
    (lambda: pointing((0, 1)), r"direction has shape \(2,\)"),
    (lambda: PAPER.centreline(np.zeros(8), 0), "n is 0"),
    (lambda: PAPER.centreline(np.zeros(8), 2.5), "n is 2.5"),
]


ALL = ROD + PARTS + THINGS + CALLS


@pytest.mark.parametrize(("build", "message"), ALL, ids=[message for _, message in ALL])
def test_bad_input_is_one_sentence_that_names_it(build, message):
    with pytest.raises((ValueError, TypeError), match=message) as caught:
        build()
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "build",
    [
        lambda: Material(1e6, 0.5, 1000),
        lambda: Material(1e6, -0.99, 1000, 0.0),
        lambda: Material(np.float64(1e6), np.float32(0.25), 1000),
        lambda: Payload(0.0),
        lambda: Payload(0.1, inertia=np.eye(3)),
        lambda: Strain(bending_y=np.int64(2), bending_z=Legendre(np.int64(1))),
        lambda: replace(PAPER, quadrature_points=np.int64(8)),
        lambda: BSpline(np.int64(1), np.int64(3)),
        lambda: UserBasis(ca.cos),
        lambda: replace(PAPER, gravity=np.array([0.0, 0.0, -9.81])),
        lambda: replace(PAPER, cables=[Cable([0.02, 0.0])]),
        lambda: replace(PAPER, cables=Cable((0.02, 0.0)), payloads=Payload(0.1)),
    ],
)
def test_what_is_in_range_is_taken(build):
    """Rubber, no damping, numbers of numpy's kinds, lists, one thing in place of several."""
    assert hash(build()) == hash(build())


def test_wrong_types_are_type_errors():
    for build in (lambda: replace(PAPER, section=0.03), lambda: replace(PAPER, drag=1.0)):
        with pytest.raises(TypeError):
            build()


def test_a_cable_outside_the_section_is_warned_of():
    with pytest.warns(UserWarning, match=r"cable 0 runs at \(y, z\) = \(0.04, 0\) m at s = 0 m, outside the section"):
        replace(PAPER, cables=(Cable((0.04, 0.0)),))


def test_a_rod_is_plain_hashable_data():
    assert Rod.preset("paper") == PAPER
    assert hash(Rod.preset("paper")) == hash(PAPER)
    assert replace(PAPER, gravity=(0, 0, 1)) != PAPER
    assert replace(PAPER, length=0.5).length == 0.5
    assert replace(TWO, material=Material(2e6, 0.5, 1000)).divisions[1].material.young == 2e6


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
    for outside, inside in ((-0.1, 0.0), (0.7, 0.6)):
        assert np.allclose(pose(bent.q, outside).full(), pose(bent.q, inside).full(), atol=1e-15)
    curvature = bent.q[4 + 0]
    midway = pose(bent.q, 0.3).full()
    assert np.arctan2(midway[1, 0], midway[0, 0]) == pytest.approx(0.3 * curvature, abs=1e-12)
    assert np.allclose(bent.centreline(3)[1], midway[:3, 3], atol=1e-15)
    assert np.allclose(bent.frames(3)[1], midway, atol=1e-15)
    assert np.allclose(PAPER.frames(bent.q, 3)[2][:3, :3], bent.rotation, atol=1e-15)


def test_a_rod_without_cables_rests_and_vibrates():
    bare = replace(PAPER, cables=(), gravity=(0.0, 0.0, -9.81))
    assert bare.equilibrium().tip[2] < -0.1
    assert bare.rhs(np.zeros(2 * bare.dof), np.zeros(0)).shape == (2 * bare.dof, 1)


def test_without_a_compiler_the_step_is_interpreted_with_the_same_result(monkeypatch):
    x, tension = np.zeros(2 * PAPER.dof), [5.0, 0.0, 0.0]
    machine = PAPER.step(0.05)(x, tension, np.zeros(3)).full()
    monkeypatch.setenv("CC", "no-such-compiler")
    monkeypatch.setattr("socasadi.codegen._compile.warn_interpreted", lambda: None)
    interpreted = copy.deepcopy(PAPER).step(0.05)(x, tension, np.zeros(3)).full()
    assert np.allclose(machine, interpreted, rtol=1e-10, atol=1e-12)
