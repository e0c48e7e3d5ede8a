"""Cables and chambers: their lengths, what they pull with, how friction and given lengths act."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from rod_support import CIRCLE, SILICONE, coordinates, derivative, rich_rod, silicone_rod, values
from scipy.optimize import brentq

from socasadi.rod import (
    Cable,
    Chamber,
    Converging,
    Division,
    EquilibriumError,
    Helix,
    Rod,
    Strain,
    cables_around,
    piecewise_constant,
)

FREE = Strain(bending_y=2, bending_z=2, torsion=1, stretch=0, shear_y=0, shear_z=0)
ROUTES = {
    "straight": (0.01, 0.02),
    "converging": Converging((0.02, 0.005), (0.005, -0.01), 0.6),
    "helix": Helix(0.02, 0.3, 0.4),
    "left helix": Helix(0.015, -0.7),
    "user": lambda s: (0.02 * ca.cos(3 * s), 0.01 + 0.02 * s**2),
}
THREE = cables_around(3, 0.02)
EI, GJ, EA = 1e6 * CIRCLE.Iz, 1e6 / 3 * CIRCLE.J, 1e6 * CIRCLE.area


def rod(strain=FREE, **changes) -> Rod:
    return silicone_rod(strain, **changes)


@pytest.mark.parametrize("route", ROUTES.values(), ids=ROUTES)
@pytest.mark.parametrize(("start", "end"), [(0.0, None), (0.1, 0.45)], ids=["whole", "part"])
def test_the_length_is_that_of_a_polyline_through_the_deformed_rod(route, start, end):
    cable = Cable(route, start=start, end=end)
    bent = rod(cables=(cable,), quadrature_points=24)
    q, lines = coordinates(bent), 1500
    stations = np.linspace(start, end or 0.6, lines + 1)
    poses = bent.pose.map(lines + 1)(np.tile(q[:, None], lines + 1), stations[None, :]).full()
    poses = poses.reshape(4, lines + 1, 4).transpose(1, 0, 2)
    places = np.array([[0, *(float(part) for part in cable.at(s)), 1] for s in stations])
    points = np.einsum("nij,nj->ni", poses, places)[:, :3]
    length = np.linalg.norm(np.diff(points, axis=0), axis=1).sum()
    assert values(bent.model.cable_lengths, q) == pytest.approx([length], rel=1e-6)


def test_actuation_is_minus_the_derivative_of_the_lengths_and_rates_are_along_it():
    cables = tuple(Cable(route, end=end) for route in ROUTES.values() for end in (None, 0.4))
    bent = rod(cables=cables)
    q, v = coordinates(bent), coordinates(bent, 1)
    numeric = derivative(lambda q: values(bent.model.cable_lengths, q), q, 1e-3)
    assert np.allclose(values(bent.actuation, q), -numeric.T, rtol=0, atol=1e-12)
    assert np.allclose(values(bent.model.cable_rates, q, v), numeric @ v, rtol=0, atol=1e-11)


def test_cables_do_not_depend_on_their_company():
    cables = rich_rod().cables
    everyone = rich_rod()
    q = coordinates(everyone)
    together = values(everyone.actuation, q)
    for i, cable in enumerate(cables):
        alone = rich_rod(cables=(cable,))
        assert np.allclose(values(alone.actuation, q), together[:, i], rtol=0, atol=1e-15)
        assert values(alone.model.cable_lengths, q) == pytest.approx(
            values(everyone.model.cable_lengths, q)[i], rel=1e-14
        )


@pytest.mark.parametrize("pitch", [0.3, -0.3, 0.05])
def test_a_helical_cable_has_the_length_of_a_helix_and_twists_the_rod(pitch):
    """T r^2 (w + k) / sqrt(s^2 + r^2 (w + k)^2) per metre, w = 2 pi / pitch: a right-handed one twists to the left."""
    r, T, w = 0.02, 5.0, 2 * np.pi / pitch
    wound = rod(Strain(torsion=0, stretch=0), cables=(Cable(Helix(r, pitch)),))
    length = np.sqrt(0.6**2 + (2 * np.pi * r * 0.6 / pitch) ** 2)
    assert values(wound.model.cable_lengths, [0, 0]) == pytest.approx([length], rel=1e-12)
    twist, stretch = wound.equilibrium([T]).q
    speed = np.hypot(1 + stretch, r * (w + twist))
    assert GJ * twist == pytest.approx(-T * r**2 * (w + twist) / speed, rel=1e-11)
    assert EA * stretch == pytest.approx(-T * (1 + stretch) / speed, rel=1e-11)
    assert np.sign(twist) == -np.sign(pitch)


def test_a_helix_turns_from_y_towards_z():
    y, z = Helix(0.02, 0.4, np.pi / 2)(0.1)
    assert (float(y), float(z)) == pytest.approx((-0.02, 0.0), abs=1e-15)
    y, z = Helix(0.02, -0.4)(0.1)
    assert (float(y), float(z)) == pytest.approx((0.0, -0.02), abs=1e-15)


def test_a_converging_cable_bends_less_and_less():
    """At each place EI kappa = T d (1 - kappa d) / sqrt((1 - kappa d)^2 + d'^2): virtual work of its length."""
    base, tip, T = 0.025, 0.005, 10.0
    bent = rod(Strain(bending_z=8), cables=(Cable(Converging((base, 0), (tip, 0), 0.6)),)).equilibrium([T])
    slope = (tip - base) / 0.6
    for s in (0.05, 0.3, 0.55):
        d = base + slope * s
        exact = brentq(lambda k: EI * k - T * d * (1 - k * d) / np.hypot(1 - k * d, slope), 0, 10)  # noqa: B023
        assert values(bent.rod.model.strain, bent.q, s)[2] == pytest.approx(exact, rel=1e-7)


def test_a_cable_bends_the_rod_between_where_it_enters_and_where_it_ends():
    strain = Strain(bending_z=piecewise_constant(3))
    bent = rod(strain, cables=(Cable((0.02, 0.0), start=0.2, end=0.4),)).equilibrium([5.0])
    assert bent.q == pytest.approx([0, 5.0 * 0.02 / EI, 0], rel=1e-12, abs=1e-15)
    part = Division(0.3, CIRCLE, SILICONE, Strain(bending_z=1))
    half = Rod(divisions=(part, part), cables=(Cable((0.02, 0.0), end=0.3), Cable((-0.02, 0.0))))
    assert half.equilibrium([5.0, 0.0]).q == pytest.approx([5.0 * 0.02 / EI, 0, 0, 0], rel=1e-12, abs=1e-15)
    assert half.equilibrium([5.0, 2.0]).q == pytest.approx(
        np.array([3.0, 0, -2.0, 0]) * 0.02 / EI, rel=1e-12, abs=1e-15
    )
    inside = rod(strain, cables=(Cable((0.02, 0.0), end=0.3),)).equilibrium([5.0]).q
    assert inside == pytest.approx(np.array([1, 0.5, 0]) * 5.0 * 0.02 / EI, rel=1e-12, abs=1e-15)


def test_cables_around_are_evenly_spaced_from_y():
    y, z = np.array([cable.route for cable in cables_around(4, 0.02)]).T
    assert np.allclose(y, [0.02, 0, -0.02, 0], atol=1e-17)
    assert np.allclose(z, [0, 0.02, 0, -0.02], atol=1e-17)


def test_a_chamber_pushes_with_pressure_times_area():
    area, pressure = 1e-4, 5e4
    blown = rod(cables=(Chamber((0.02, 0.0), area), Chamber(Helix(0.02, 0.3), 2 * area, start=0.1, end=0.5)))
    pulled = rod(cables=(Cable((0.02, 0.0)), Cable(Helix(0.02, 0.3), start=0.1, end=0.5)))
    q = coordinates(blown)
    assert np.allclose(values(blown.actuation, q), -area * values(pulled.actuation, q) * [1, 2], rtol=0, atol=1e-18)
    one, other = blown.equilibrium([pressure, 0]), pulled.equilibrium([-pressure * area, 0])
    assert np.allclose(one.tip, other.tip, rtol=0, atol=1e-12)
    assert one.tip[1] < 0  # away from the chamber
    free = replace(blown, strain=Strain(stretch=0)).equilibrium([pressure, 0]).q
    assert free == pytest.approx([pressure * area / EA], rel=1e-12)


@pytest.mark.parametrize("divisions", [1, 3])
def test_friction_follows_the_capstan_law_along_an_arc(divisions):
    """A rod bent by theta: the tension's mean is (1 - exp(-mu theta)) / (mu theta) of what is pulled with."""
    theta, mu = 2.5, 0.3
    part = Division(0.6 / divisions, CIRCLE, SILICONE, Strain(bending_z=0, stretch=0))
    arc = Rod(divisions=(part,) * divisions, cables=(Cable((0.02, 0.0), friction=mu), Cable((0.02, 0.0))))
    q = np.tile([theta / 0.6, 0.0], divisions)
    rubbed, free = values(arc.actuation, q)[0::2].T
    ends = np.linspace(0, theta, divisions + 1)
    mean = (np.exp(-mu * ends[:-1]) - np.exp(-mu * ends[1:])) / (mu * theta / divisions)
    assert np.allclose(rubbed / free, mean, rtol=1e-11, atol=0)


def test_friction_over_pieces_that_bend_differently_and_of_a_cable_that_starts_late():
    mu, kappa = 0.4, np.array([3.0, -5.0, 2.0])
    strain = Strain(bending_z=piecewise_constant(3))
    cables = (Cable((0.01, 0.0), friction=mu), Cable((0.01, 0.0), friction=mu, start=0.2))
    bent = rod(strain, cables=cables, quadrature_points=6)
    plain = values(replace(bent, cables=(Cable((0.01, 0.0)),)).actuation, kappa)
    turned = np.concatenate([[0], np.cumsum(0.2 * np.abs(kappa))])
    mean = -np.diff(np.exp(-mu * turned)) / (mu * np.diff(turned))
    later = turned[1:] - turned[1]
    mean_later = [0, *(-np.diff(np.exp(-mu * later)) / (mu * np.diff(later)))]
    assert np.allclose(values(bent.actuation, kappa).T / plain, [mean, mean_later], rtol=0, atol=1e-12)
    coarse = values(rod(strain, cables=cables).actuation, kappa).T
    assert np.allclose(coarse / plain, [mean, mean_later], rtol=0, atol=1e-5)


def test_a_helix_rubs_even_on_a_straight_rod():
    """Its curvature is r w^2 / (1 + r^2 w^2) per length of the cable."""
    r, w, mu = 0.02, 2 * np.pi / 0.3, 0.2
    wound = rod(Strain(stretch=0), cables=(Cable(Helix(r, 0.3), friction=mu), Cable(Helix(r, 0.3))))
    rubbed, free = values(wound.actuation, [0.0]).ravel()
    angle = 0.6 * r * w**2 / np.sqrt(1 + (r * w) ** 2)
    assert rubbed / free == pytest.approx((1 - np.exp(-mu * angle)) / (mu * angle), rel=1e-10)


def test_a_cable_in_space_turns_by_the_angle_of_its_tangent():
    """On a rod bent and twisted at will, against the angle between steps of a polyline along the cable."""
    mu, cable = 0.5, Cable(Helix(0.02, 0.5), friction=0.5)
    bent = rod(Strain(stretch=4, bending_y=1, bending_z=1, torsion=1), cables=(cable, replace(cable, friction=0.0)))
    bent = replace(bent, quadrature_points=12)
    q, lines = coordinates(bent, 3), 3000
    q[-5:] = 0
    stations = np.linspace(0, 0.6, lines + 1)
    poses = bent.pose.map(lines + 1)(np.tile(q[:, None], lines + 1), stations[None, :]).full()
    poses = poses.reshape(4, lines + 1, 4).transpose(1, 0, 2)
    places = np.array([[0, *(float(part) for part in cable.at(s)), 1] for s in stations])
    lengths = np.diff(np.einsum("nij,nj->ni", poses, places)[:, :3], axis=0)
    tangents = lengths / np.linalg.norm(lengths, axis=1)[:, None]
    angles = np.arcsin(np.linalg.norm(np.cross(tangents[1:], tangents[:-1]), axis=1))
    turned = np.concatenate([[0.5 * angles[0]], 0.5 * angles[0] + np.cumsum(angles)])
    # What pulls on the uniform stretch is the mean of the axial direction cosine times what is left of the tension.
    cosines = np.einsum("ni,ni->n", tangents, poses[:-1, :3, 0])
    actuation = values(bent.actuation, q)
    assert actuation[-5, 1] == pytest.approx(-0.6 * cosines.mean(), rel=1e-3)
    rubbed = -0.6 * (cosines * np.exp(-mu * turned)).mean()
    assert actuation[-5, 0] == pytest.approx(rubbed, rel=2e-3)
    assert rubbed / actuation[-5, 1] < 0.6


def test_friction_does_not_ask_whether_a_strain_is_at_rest_or_not():
    """A twist that grows along the rod turns its cable alike as rest strain and as a coordinate."""
    cables = (Cable((0.02, 0.0), friction=0.5),)
    made = rod(Strain(torsion=1, stretch=0, rest=lambda x: (20 * x, 0, 0, 1, 0, 0)), cables=cables)
    turned = rod(Strain(torsion=1, stretch=0), cables=cables)
    expected = values(turned.actuation, [10, 10, 0])
    assert np.allclose(values(made.actuation, [0, 0, 0]), expected, rtol=0, atol=1e-14)
    free = values(replace(turned, cables=(Cable((0.02, 0.0)),)).actuation, [10, 10, 0])
    assert expected[2] / free[2] < 0.9


def test_lengths_given_are_reached_by_the_tensions_that_have_them():
    """With gravity, and a rod that must stretch: three lengths, three tensions."""
    pulled = rod(cables=THREE, gravity=(0, 1, -5)).equilibrium([5.0, -3.0, 2.0], tip_force=(0, 0.1, 0))
    back = pulled.rod.equilibrium(lengths=pulled.lengths, tip_force=(0, 0.1, 0))
    assert np.allclose(back.tension, [5.0, -3.0, 2.0], rtol=0, atol=1e-8)
    assert np.allclose(back.tip, pulled.tip, rtol=0, atol=1e-11)
    assert np.allclose(back.lengths, pulled.lengths, rtol=0, atol=1e-14)
    shortened = rod(cables=THREE).equilibrium(lengths=[0.55, 0.6, 0.6])
    assert np.allclose(shortened.lengths, [0.55, 0.6, 0.6], rtol=0, atol=1e-13)
    assert shortened.tip[1] > 0.1


def servos(stiffness: float, slack: bool = True) -> Rod:
    return rod(cables=tuple(replace(c, drive="length", stiffness=stiffness, slack=slack) for c in THREE))


def test_a_servo_pulls_with_its_stiffness_times_what_it_is_short_of():
    rod = servos(2e4)
    assert np.allclose(rod.neutral, 0.6, rtol=0, atol=1e-15)
    held = rod.equilibrium([0.58, 0.595, 0.61])
    assert np.allclose(held.tension, np.maximum(2e4 * (held.lengths - [0.58, 0.595, 0.61]), 0), rtol=0, atol=1e-9)
    assert held.tension[2] == 0  # slack
    assert (held.tension[:2] > 0).all()
    by_tension = replace(rod, cables=THREE).equilibrium(held.tension)
    assert np.allclose(by_tension.tip, held.tip, rtol=0, atol=1e-11)
    rigid = servos(2e4, slack=False).equilibrium([0.58, 0.595, 0.61])
    assert rigid.tension[2] < 0
    assert np.allclose(rigid.tension, 2e4 * (rigid.lengths - [0.58, 0.595, 0.61]), rtol=0, atol=1e-9)
    assert np.allclose(rod.equilibrium().tip, [0.6, 0, 0], rtol=0, atol=1e-15)
    assert np.allclose(values(rod.model.tensions, np.zeros(rod.dof), [0.59, 0.6, 0.7]), [200, 0, 0], atol=1e-9)


def test_a_stiff_servo_is_a_given_length():
    lengths = [0.58, 0.6, 0.6]
    exact = rod(cables=THREE).equilibrium(lengths=lengths)
    errors = [np.linalg.norm(servos(k, slack=False).equilibrium(lengths).tip - exact.tip) for k in (1e5, 1e6)]
    assert errors[1] < 5e-4
    assert errors[0] / errors[1] == pytest.approx(10, rel=0.2)


def test_a_servo_moves_the_rod_as_the_equations_say_and_settles():
    strain = Strain(bending_y=1, bending_z=1, stretch=0)
    moving = rod(strain, cables=tuple(replace(c, drive="length", stiffness=1e4, slack=False) for c in THREE))
    given, start = [0.59, 0.6, 0.602], np.zeros(2 * moving.dof)
    exact = values(moving.reference_step(0.1), start, given, np.zeros(3))
    errors = [
        np.linalg.norm((values(moving.step_expression(0.1, h), start, given, np.zeros(3)) - exact)[: moving.dof])
        for h in (0.001, 0.0005, 0.00025)
    ]
    assert errors[-1] < 2e-3 * np.linalg.norm(exact[: moving.dof])
    assert errors[1] / errors[2] > 3
    damped = replace(moving, material=replace(SILICONE, damping=5e4))
    step, x = damped.step_expression(1.0, 0.01), start
    for _ in range(7):
        x = values(step, x, given, np.zeros(3))
    assert np.allclose(x, damped.equilibrium(given).state, rtol=0, atol=1e-5)


def test_a_servo_and_a_tension_share_a_rod():
    cables = (replace(THREE[0], drive="length", stiffness=1e4), THREE[1], Chamber((0.0, -0.01), 1e-4))
    mixed = rod(cables=cables)
    assert np.allclose(mixed.neutral, [0.6, 0, 0])
    held = mixed.equilibrium([0.59, 3.0, 1e4])
    assert held.tension[1:] == pytest.approx([3.0, 1e4])
    assert held.tension[0] == pytest.approx(1e4 * (held.lengths[0] - 0.59), rel=1e-9)
    x = held.state
    assert np.abs(values(mixed.rhs, x, held.input)).max() < 1e-7
    B = mixed.linearise(held).B
    assert np.allclose(
        B[mixed.dof :, 0], -1e4 * np.linalg.solve(values(mixed.mass, held.q), values(mixed.actuation, held.q)[:, 0])
    )


@pytest.mark.parametrize(("count", "free"), [(3, {}), (4, {"stretch": 0}), (3, {"stretch": 0}), (5, {"stretch": 0})])
def test_redundant_cables_take_the_lengths_of_an_arc_and_the_least_tensions(count, free):
    """On an arc of curvature k a cable at offset d towards the centre is k d shorter per metre."""
    rod = silicone_rod(Strain(bending_y=0, bending_z=0, **free), cables=cables_around(count, 0.02))
    around = np.cos(2 * np.pi * np.arange(count) / count)
    lengths = 0.6 * (1 - 2.0 * 0.02 * around)
    bent = rod.equilibrium(lengths=lengths)
    assert np.allclose(bent.lengths, lengths, atol=1e-12)
    EI = 1e6 * np.pi * 0.03**4 / 4
    # of all tensions with the moment EI k, those of least norm go with the cables' offsets
    assert np.allclose(bent.tension, EI * 2.0 / 0.02 * around / (around @ around), atol=1e-6)


def test_lengths_that_no_strain_allows_are_refused():
    inextensible = silicone_rod(Strain(bending_y=0, bending_z=0), cables=cables_around(3, 0.02))
    with pytest.raises(EquilibriumError, match=r"lengths \[0.61, 0.61, 0.6\] m together: .* 6.67 mm away"):
        inextensible.equilibrium(lengths=[0.61, 0.61, 0.60])
