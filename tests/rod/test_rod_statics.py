"""Static poses against exact solutions and published tables."""

from dataclasses import replace
from math import cos, pi, sin

import numpy as np
import pytest

from socasadi.rod import Equilibrium, EquilibriumError, Material, Rod, Section, Strain

PAPER = Rod.preset("paper")


def slender(order: int, points: int, gravity=(0.0, 0.0, 0.0)) -> Rod:
    """L = 1, EI = 1, inextensible and shear-rigid; loads are numbers without units."""
    strain = Strain(bending_y=order, bending_z=order, torsion=0)
    section = Section(area=1e6, Iy=1.0, Iz=1.0)
    return Rod(1.0, section, Material(1.0, 0.5, 1.0), strain, gravity=gravity, quadrature_points=points)


def test_one_cable_bends_the_rod_into_an_arc():
    F, d, E, r, L = 10.0, 0.02, 1e6, 0.03, 0.6
    curvature = F * d / (E * pi * r**4 / 4)
    stretch = 1 - F / (E * pi * r**2)
    arc = stretch * np.array([sin(curvature * L), 1 - cos(curvature * L), 0]) / curvature
    equilibrium = PAPER.equilibrium(tension=[F, 0, 0])
    assert np.allclose(arc, [0.594339, 0.056221, 0], atol=1e-6)
    assert np.allclose(equilibrium.tip, arc, rtol=0, atol=1e-12)
    angle = curvature * L
    turned = [[cos(angle), -sin(angle), 0], [sin(angle), cos(angle), 0], [0, 0, 1]]
    assert np.allclose(equilibrium.rotation, turned, atol=1e-12)


@pytest.mark.parametrize("cable", [0, 1, 2])
def test_each_cable_bends_towards_its_own_side(cable):
    tip = PAPER.equilibrium(tension=10.0 * np.eye(3)[cable]).tip
    angle = 2 * pi * cable / 3
    assert np.allclose(tip[1:], 0.056221 * np.array([cos(angle), sin(angle)]), atol=1e-6)


def test_hanging_stiffens():
    """Gravity along the rod halves what a cable reaches."""
    hung = Rod.preset("hanging").equilibrium(tension=[10, 0, 0]).tip[1]
    assert 0.4 < hung / 0.056221 < 0.6


def test_the_printed_rod_hardly_moves():
    tip = Rod.preset("paper_literal").equilibrium(tension=[10, 0, 0]).tip
    assert tip[1] == pytest.approx(2.29e-3, abs=2e-5)  # F d L^2 / (2 E I), d = r = 0.1 m


@pytest.mark.parametrize(
    ("load", "sag", "shortening"),
    [(1, 0.301721, 0.056433), (2, 0.493457, 0.160642), (5, 0.713792, 0.387628), (10, 0.810609, 0.554996)],
)
def test_dead_tip_load_follows_the_elastica(load, sag, shortening):
    tip = slender(8, 14).equilibrium(tip_force=(0, 0, load)).tip
    assert np.allclose([tip[2], 1 - tip[0]], [sag, shortening], rtol=0, atol=1e-5)


@pytest.mark.parametrize(
    ("weight", "sag", "shortening"), [(1, 0.123471, 0.008754), (5, 0.495905, 0.153343), (10, 0.700200, 0.343646)]
)
def test_heavy_cantilever(weight, sag, shortening):
    tip = slender(6, 10, gravity=(0, -weight / 1e6, 0)).equilibrium().tip
    assert np.allclose([-tip[1], 1 - tip[0]], [sag, shortening], rtol=0, atol=2e-5)


def test_an_upright_rod_buckles_at_the_known_weight():
    """Greenhill: w L^3 / EI = 7.8373."""

    def softest(weight):
        return slender(6, 10, gravity=(-weight / 1e6, 0, 0)).modes().frequency[0]

    assert softest(7.83) > 0
    assert softest(7.845) == 0


def test_a_pure_moment_bends_the_rod_into_circles():
    for turns in (1, 2):  # two turns: Simo and Vu-Quoc 1986, example 7.1
        equilibrium = slender(2, 6).equilibrium(tip_moment=(0, 0, 2 * pi * turns))
        assert np.allclose(equilibrium.tip, 0, atol=1e-10)
        assert np.allclose(equilibrium.rotation, np.eye(3), atol=1e-9)
    circle = slender(0, 6).equilibrium(tip_moment=(0, 0, 2 * pi)).centreline(101)
    assert np.allclose(np.linalg.norm(circle - [0, 0.5 / pi, 0], axis=1), 0.5 / pi, atol=1e-12)


@pytest.mark.parametrize(
    ("load", "tip"),
    [(300, (58.7791, 22.2448, 40.1919)), (450, (52.2386, 18.5082, 48.5029)), (600, (47.1504, 15.6848, 53.4749))],
)
def test_forty_five_degree_bend(load, tip):
    """Bathe and Bolourchi's curved cantilever; converged values, within 1 % of those in print."""
    free = {"bending_y": 6, "bending_z": 6, "torsion": 6, "stretch": 1, "shear_y": 1, "shear_z": 1}
    strain = Strain(**free, rest=(0, 0, 1 / 100, 1, 0, 0))
    section = Section(area=1, Iy=1 / 12, Iz=1 / 12, torsion_constant=1 / 6)
    rod = Rod(100 * pi / 4, section, Material(1e7, 0.0, 1.0), strain, quadrature_points=10)
    assert np.allclose(rod.equilibrium(tip_force=(0, 0, load)).tip, tip, rtol=0, atol=2e-3)


def test_actuation_is_minus_the_derivative_of_the_cable_lengths():
    """The lengths are those of polylines through points of the deformed rod."""
    q = np.random.default_rng(0).normal(size=PAPER.dof) * np.array([1, 1, 1, 1, 1, 1, 1, 0.1])
    lines, h = 2000, 1e-4
    rod = replace(PAPER, quadrature_points=20)

    def lengths(q):
        stations = np.linspace(0, PAPER.length, lines + 1)
        poses = rod.pose.map(lines + 1)(np.tile(q[:, None], lines + 1), stations[None, :]).full()
        poses = poses.reshape(4, lines + 1, 4).transpose(1, 0, 2)
        offsets = np.array([[0, *cable.route, 1] for cable in PAPER.cables])
        points = (poses @ offsets.T)[:, :3]
        return np.linalg.norm(np.diff(points, axis=0), axis=1).sum(axis=0)

    derivative = np.array([(lengths(q + h * e) - lengths(q - h * e)) / (2 * h) for e in np.eye(PAPER.dof)])
    assert np.allclose(rod.actuation(q).full(), -derivative, rtol=0, atol=1e-6)
    assert np.allclose(rod.model.cable_lengths(q).full()[:, 0], lengths(q), rtol=0, atol=1e-6)


@pytest.mark.parametrize("bounds", [(-np.inf, np.inf), (0, 10), (-10, 10)])
def test_the_tip_is_held_where_asked_within_the_bounds(bounds):
    target = np.array([-0.01, 0.04])
    held = PAPER.equilibrium_at(target, bounds)
    assert np.allclose(held.tip[1:], target, rtol=0, atol=1e-9)
    assert (held.tension >= bounds[0]).all()
    assert (held.tension <= bounds[1]).all()
    assert np.allclose(PAPER.equilibrium(held.tension).tip, held.tip, atol=1e-10)


def test_no_other_tensions_within_the_bounds_hold_the_tip_with_less_norm():
    """Along the curve of tensions that hold the tip the norm is stationary, or a bound stops the descent."""
    for bounds in [(-np.inf, np.inf), (0.0, 10.0)]:
        held = PAPER.equilibrium_at((-0.01, 0.04), bounds)
        h = 1e-3
        columns = [PAPER.equilibrium(held.tension + h * e).tip[1:] for e in np.eye(3)]
        sensitivity = (np.array(columns) - held.tip[1:]).T / h
        free = np.linalg.svd(sensitivity)[2][-1]  # the direction that leaves the tip in place
        slope = free @ held.tension
        if np.isinf(bounds[0]):
            assert abs(slope) < 2e-3 * np.linalg.norm(held.tension)
        else:
            downhill = -np.sign(slope) * free
            assert (downhill[held.tension <= bounds[0] + 1e-9] < 0).any()


def test_out_of_reach_says_by_how_much():
    with pytest.raises(EquilibriumError, match=r"nearest static pose has it at .* 87\.8 mm away"):
        PAPER.equilibrium_at((0.2, 0.0), (-10, 10))


def test_no_equilibrium_is_a_named_error():
    with pytest.raises(EquilibriumError, match="no equilibrium found under cable inputs"):
        PAPER.equilibrium(tension=[1e5, 1e5, 1e5])


def test_resting_tensions_are_the_admissible_ones_closest_to_zero():
    resting = PAPER.resting((1.0, [5.0, 6.0, 7.0]))
    assert isinstance(resting, Equilibrium)
    assert np.allclose(resting.tension, 1.0)
    assert np.allclose(resting.tip[1:], 0, atol=1e-15)


def test_gravity_is_replaced_in_a_copy():
    hung = replace(PAPER, gravity=(9.81, 0, 0))
    assert hung == Rod.preset("hanging")
    stretch = 1000 * 9.81 * 0.6**2 / (2 * 1e6)  # rho g L^2 / 2E: a column under its weight, mean strain constant
    assert hung.equilibrium().tip[0] - 0.6 == pytest.approx(stretch, rel=1e-12)


@pytest.mark.parametrize("rod", [PAPER, Rod.preset("hanging")], ids=["paper", "hanging"])
def test_whatever_tensions_reach_can_be_held_with_no_more_effort(rod):
    random = np.random.default_rng(0)
    for bounds in [(-np.inf, np.inf), (0, 10), (-10, 10)] * 3:
        tension = random.uniform(max(bounds[0], -10), 10, size=3)
        target = rod.equilibrium(tension).tip[1:]
        held = rod.equilibrium_at(target, bounds)
        assert np.allclose(held.tip[1:], target, rtol=0, atol=1e-9)
        assert np.linalg.norm(held.tension) <= np.linalg.norm(tension) + 1e-9


def test_a_fixed_cable_keeps_its_tension():
    target = PAPER.equilibrium([3.0, 1.0, -2.0]).tip[1:]
    held = PAPER.equilibrium_at(target, ([-10, 1, -10], [10, 1, 10]))
    assert np.allclose(held.tension, [3, 1, -2], atol=1e-7)
