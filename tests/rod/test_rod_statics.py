"""Static poses against exact solutions and published tables."""

from dataclasses import replace
from math import cos, pi, sin, sqrt

import numpy as np
import pytest
from rod_support import slender
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from socasadi.rod import Material, Rod, Section, Strain

PAPER = Rod.preset("paper")


def beam(order: int, points: int, **changes) -> Rod:
    return slender(Strain(bending_y=order, bending_z=order, torsion=0), quadrature_points=points, **changes)


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
    tip = beam(9, 16).equilibrium(tip_force=(0, 0, load)).tip
    assert np.allclose([tip[2], 1 - tip[0]], [sag, shortening], rtol=1e-4, atol=0)


@pytest.mark.parametrize(
    ("load", "printed"),
    [(10, (58.313, 71.107)), (50, (2.006, 44.827)), (90, (47.622, 6.086)), (130, (24.139, -47.859))],
)
def test_follower_tip_force(load, printed):
    """A force (kN) that stays normal to the tip section: in the tip's frame it is given, so that the elastica
    EI theta'' = -P cos(theta - theta_tip) is an initial value problem from the tip."""
    L, EI, P = 100.0, 3.5e7, 1e3 * load

    def slopes(_, state):  # from the tip towards the base, in axes along tangent and force at the tip
        _, _, angle, curvature = state
        return [-cos(angle), -sin(angle), -curvature, P / EI * cos(angle)]

    x, y, angle, _ = solve_ivp(slopes, (0, L), [0, 0, 0, 0], method="DOP853", rtol=1e-12, atol=1e-12).y[:, -1]
    exact = [-x * cos(angle) - y * sin(angle), x * sin(angle) - y * cos(angle)]
    section = Section(area=1e6, Iy=1.0, Iz=1.0)
    rod = Rod(L, section, Material(EI, 0.0, 1.0), Strain(bending_y=11), quadrature_points=40)
    tip = rod.equilibrium(follower_force=(0, 0, P)).tip[[0, 2]]
    assert np.allclose(exact, printed, rtol=0, atol=1e-3)
    assert np.allclose(tip, exact, rtol=1e-4, atol=0)


@pytest.mark.parametrize(
    ("weight", "sag", "shortening"), [(1, 0.123471, 0.008754), (5, 0.495905, 0.153343), (10, 0.700200, 0.343646)]
)
def test_heavy_cantilever(weight, sag, shortening):
    tip = beam(8, 12, gravity=(0, -weight / 1e6, 0)).equilibrium().tip
    assert np.allclose([-tip[1], 1 - tip[0]], [sag, shortening], rtol=1e-4, atol=0)


def test_an_upright_rod_buckles_at_greenhills_weight():
    """w L^3 / EI = 7.8373 (Greenhill 1881): where the smallest eigenvalue of the tangent stiffness vanishes."""

    def stability(weight):
        rod = slender(Strain(bending_z=6), quadrature_points=24, gravity=(-weight / 1e6, 0, 0))
        return rod.equilibrium().stability

    assert stability(0.0) == pytest.approx(1, abs=1e-12)
    assert brentq(stability, 7, 9, xtol=1e-6) == pytest.approx(7.83735, rel=2e-6)


def test_a_compressed_cantilever_buckles_at_eulers_load():
    rod = slender(Strain(bending_z=6), quadrature_points=24)

    def stability(load):
        return rod.equilibrium(tip_force=(-load, 0, 0)).stability

    assert brentq(stability, 2, 3, xtol=1e-8) == pytest.approx(pi**2 / 4, rel=1e-6)


def test_a_pure_moment_bends_the_rod_into_circles():
    for turns in (1, 2, 5):
        equilibrium = beam(2, 12).equilibrium(tip_moment=(0, 0, 2 * pi * turns))
        assert np.allclose(equilibrium.tip, 0, atol=1e-10)
        assert np.allclose(equilibrium.rotation, np.eye(3), atol=1e-9)
    circle = beam(0, 6).equilibrium(tip_moment=(0, 0, 2 * pi)).centreline(101)
    assert np.allclose(np.linalg.norm(circle - [0, 0.5 / pi, 0], axis=1), 0.5 / pi, atol=1e-12)


def test_two_turns_of_simo_and_vu_quoc():
    """Example 7.1 (1986): EI = 2, L = 1, M = 8 pi winds the rod up twice."""
    rod = Rod(1.0, Section(1.0, 1.0, 1.0), Material(2.0, 0.0, 1.0), Strain(bending_y=0, bending_z=0))
    wound = rod.equilibrium(tip_moment=(0, -8 * pi, 0))
    assert np.allclose(wound.tip, 0, atol=1e-12)
    half = rod.pose(wound.q, 1 / 8).full()[:3, 3]  # an eighth of the rod is a quarter of a turn, of radius 1 / (4 pi)
    assert np.allclose(half, [1 / (4 * pi), 0, 1 / (4 * pi)], atol=1e-12)


@pytest.mark.parametrize(
    ("load", "tip"),
    [(300, (58.7791, 22.2448, 40.1919)), (450, (52.2386, 18.5082, 48.5029)), (600, (47.1504, 15.6848, 53.4749))],
)
def test_forty_five_degree_bend(load, tip):
    """Bathe and Bolourchi's curved cantilever; converged values, and those in print."""
    free = {"bending_y": 6, "bending_z": 6, "torsion": 6, "stretch": 1, "shear_y": 1, "shear_z": 1}
    strain = Strain(**free, rest=(0, 0, 1 / 100, 1, 0, 0))
    section = Section(area=1, Iy=1 / 12, Iz=1 / 12, torsion_constant=1 / 6)
    rod = Rod(100 * pi / 4, section, Material(1e7, 0.0, 1.0), strain, quadrature_points=10)
    assert np.allclose(rod.equilibrium().tip, [100 * sin(pi / 4), 100 * (1 - cos(pi / 4)), 0], rtol=0, atol=1e-10)
    reached = rod.equilibrium(tip_force=(0, 0, load)).tip
    assert np.allclose(reached, tip, rtol=1e-4, atol=0)
    if load == 600:
        for printed in [(47.23, 15.79, 53.37), (47.2, 15.9, 53.4)]:  # Simo and Vu-Quoc 1986; Bathe and Bolourchi 1979
            assert np.allclose(reached, printed, rtol=0.014, atol=0)


def test_princeton_beam():
    """Dowell and Traybar's aluminium beam, 13.345 N at 45 degrees: bending in both planes twists it."""
    strain = Strain(bending_y=6, bending_z=6, torsion=6, stretch=0, shear_y=0, shear_z=0)
    rod = Rod(0.508, Section.rectangle(12.377e-3, 3.2024e-3), Material(71.7e9, 0.31, 2700.0), strain)
    equilibrium = rod.equilibrium(tip_force=np.array([0, 1, 1]) * 13.345 / sqrt(2))
    assert np.allclose(equilibrium.tip[1:], [0.015341, 0.156587], rtol=1e-4, atol=0)
    assert abs(np.arctan2(equilibrium.rotation[2, 1], equilibrium.rotation[1, 1])) > 0.02


def test_a_hanging_column_stretches_by_its_weight():
    hung = replace(PAPER, gravity=(9.81, 0, 0))
    assert hung == Rod.preset("hanging")
    stretch = 1000 * 9.81 * 0.6**2 / (2 * 1e6)  # rho g L^2 / 2E, with the mean strain as the rod's only stretch
    assert hung.equilibrium().tip[0] - 0.6 == pytest.approx(stretch, rel=1e-12)
    linear = replace(hung, strain=Strain(stretch=1))
    middle = linear.pose(linear.equilibrium().q, 0.3).full()[0, 3] - 0.3
    assert middle == pytest.approx(0.75 * stretch, rel=1e-12)  # rho g (L s - s^2 / 2) / E at L / 2
