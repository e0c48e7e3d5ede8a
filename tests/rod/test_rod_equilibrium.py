"""How equilibria are found, what their stiffness and compliance say, and the tensions that hold a tip."""

from dataclasses import replace

import numpy as np
import pytest
from rod_support import coordinates, derivative, rich_rod, slender, values
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation
from scipy.special import ellipk

from socasadi.rod import BSpline, Equilibrium, EquilibriumError, Material, PointLoad, Rod, Section, Strain

PAPER = Rod.preset("paper")
RICH = rich_rod()
LOADED = RICH.equilibrium(
    [2.0, 3.0, 1.0, 1e3], (0.05, -0.1, 0.1), (0.01, 0, 0), follower_force=(-0.1, 0.1, 0.1), follower_moment=(0, 0.02, 0)
)


def residual(rod, q, given, tip_load):
    """Elastic force less all others: what the rod would accelerate with from rest, times its mass."""
    x = np.concatenate([q, np.zeros(rod.dof)])
    return -rod.mass(q).full() @ values(rod.model.loaded_rhs, x, given, tip_load)[rod.dof :]


def test_nothing_accelerates_at_an_equilibrium():
    elastic = np.abs(RICH.stiffness.full() @ LOADED.q).max()
    assert np.abs(residual(RICH, LOADED.q, LOADED.input, LOADED.tip_load)).max() < 1e-12 * elastic
    assert np.allclose(LOADED.tip, values(RICH.tip, LOADED.q), atol=1e-15)
    assert np.allclose(LOADED.centreline(5)[-1], LOADED.tip, atol=1e-14)
    assert np.allclose(LOADED.centreline(5)[0], RICH.base_position, atol=1e-15)
    assert np.array_equal(LOADED.state, [*LOADED.q, *np.zeros(RICH.dof)])


def test_tangent_stiffness_is_the_derivative_of_the_residual():
    numeric = derivative(lambda q: residual(RICH, q, LOADED.input, LOADED.tip_load), LOADED.q)
    assert np.allclose(LOADED.stiffness, numeric, rtol=0, atol=1e-8 * np.abs(numeric).max())


def test_only_follower_loads_and_friction_make_it_unsymmetric():
    dead = slender(Strain(bending_y=3, bending_z=3, torsion=1)).equilibrium(tip_force=(1, 2, 3), tip_moment=(0, 0, 0))
    assert np.allclose(dead.stiffness, dead.stiffness.T, rtol=0, atol=1e-12)
    follower = slender(Strain(bending_y=3)).equilibrium(follower_force=(0, 0, 3))
    assert np.abs(follower.stiffness - follower.stiffness.T).max() > 0.1


def test_compliance_is_what_small_loads_do():
    h = 1e-4

    def at(load):
        moment, force = LOADED.tip_load[:3] + load[:3], LOADED.tip_load[3:6] + load[3:]
        follower = {"follower_moment": LOADED.tip_load[6:9], "follower_force": LOADED.tip_load[9:]}
        moved = RICH.equilibrium(LOADED.tension, force, moment, **follower)
        turn = Rotation.from_matrix(moved.rotation @ LOADED.rotation.T).as_rotvec()
        return np.concatenate([turn, moved.tip - LOADED.tip])

    numeric = derivative(at, np.zeros(6), h, order=2)
    assert np.allclose(LOADED.compliance, numeric, rtol=0, atol=1e-6 * np.abs(numeric).max())


def test_the_straight_cantilever_has_textbook_compliance():
    """1 / EI for a moment, L^3 / 3 EI for a force, L^2 / 2 EI across, L / GJ for torsion."""
    compliance = slender(Strain(bending_y=1, bending_z=1, torsion=0)).equilibrium().compliance
    expected = np.zeros((6, 6))
    expected[0, 0] = 3 / 2  # G J = 2 / 3
    expected[1, 1] = expected[2, 2] = 1
    expected[4, 4] = expected[5, 5] = 1 / 3
    expected[2, 4] = expected[4, 2] = 1 / 2
    expected[1, 5] = expected[5, 1] = -1 / 2
    assert np.allclose(compliance, expected, rtol=0, atol=1e-12)


def test_stability_does_not_depend_on_the_parametrisation():
    loads = {"tip_force": (0, 0.5, -1)}
    legendre = slender(Strain(bending_y=3, bending_z=3)).equilibrium(**loads).stability
    spline = slender(Strain(bending_y=BSpline(3, 1), bending_z=BSpline(3, 1))).equilibrium(**loads).stability
    assert legendre == pytest.approx(spline, rel=1e-9)


def test_large_loads_are_reached_by_continuation():
    """Ten full turns, a tip load of 100 EI/L^2, gravity and tension at once."""
    wound = slender(Strain(bending_z=0)).equilibrium(tip_moment=(0, 0, 20 * np.pi))
    assert wound.q == pytest.approx([20 * np.pi])
    pulled = slender(Strain(bending_z=12), quadrature_points=24).equilibrium(tip_force=(0, 100, 0))
    assert 0.9 < pulled.tip[1] < 1
    hung = Rod.preset("hanging").equilibrium(tension=[100.0, 0, 0], tip_force=(0, 0, 5))
    assert np.isfinite(hung.tip).all()


def test_no_equilibrium_is_a_named_error_that_lists_the_loads():
    with pytest.raises(EquilibriumError, match=r"no equilibrium found under cable inputs \[100000.0, 100000.0, 1") as e:
        PAPER.equilibrium(tension=[1e5, 1e5, 1e5])
    assert "% of the loads" in str(e.value)
    listed = r"inputs \[100000.0, 100000.0, 100000.0\], tip force \[0.0, 0.5, 0.0\], gravity \[9.81, 0.0, 0.0\] m/s\^2"
    with pytest.raises(EquilibriumError, match=listed):
        Rod.preset("hanging").equilibrium(tension=[1e5, 1e5, 1e5], tip_force=(0, 0.5, 0))


def test_a_rod_pressed_to_nothing_is_no_equilibrium():
    """E A = 2827 N: the linear law would turn the rod inside out under more than that."""
    with pytest.raises(EquilibriumError):
        PAPER.equilibrium(tip_force=(-3e3, 0, 0))


def test_gravity_loads_and_inputs_act_together_and_not_in_turn():
    """The pose under several loads does not depend on whether a load is the rod's own or given."""
    own = replace(PAPER, loads=(PointLoad((0, 0.3, -0.5)), PointLoad(moment=(0, 0.1, 0), follower=True)))
    given = PAPER.equilibrium([3, 1, 0], tip_force=(0, 0.3, -0.5), follower_moment=(0, 0.1, 0))
    assert np.allclose(own.equilibrium([3, 1, 0]).tip, given.tip, rtol=0, atol=1e-13)


@pytest.mark.parametrize("bounds", [(-np.inf, np.inf), (0, 10), (-10, 10)])
def test_the_tip_is_held_where_asked_within_the_bounds(bounds):
    target = np.array([-0.01, 0.04])
    held = PAPER.equilibrium_at(target, bounds)
    assert np.allclose(held.tip[1:], target, rtol=0, atol=1e-9)
    assert (held.tension >= bounds[0]).all()
    assert (held.tension <= bounds[1]).all()
    assert np.allclose(PAPER.equilibrium(held.tension).tip, held.tip, atol=1e-10)


def test_the_tip_is_held_in_the_base_frame():
    moved = replace(PAPER, base_rotation=RICH.base_rotation, base_position=(1, 2, 3))
    held, there = PAPER.equilibrium_at((-0.01, 0.04)), moved.equilibrium_at((-0.01, 0.04))
    assert np.allclose(there.tension, held.tension, atol=1e-9)
    assert np.allclose(moved.in_base_frame(there.tip), held.tip, atol=1e-12)


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


def test_rods_that_cannot_hold_a_tip_say_so():
    with pytest.raises(EquilibriumError, match="a rod without cables cannot hold its tip"):
        replace(PAPER, cables=()).equilibrium_at((0.01, 0))
    servo = tuple(replace(cable, drive="length", stiffness=1e5) for cable in PAPER.cables)
    with pytest.raises(EquilibriumError, match="cables driven by their length"):
        replace(PAPER, cables=servo).equilibrium_at((0.01, 0))


def test_resting_tensions_are_the_admissible_ones_closest_to_zero():
    resting = PAPER.resting((1.0, [5.0, 6.0, 7.0]))
    assert isinstance(resting, Equilibrium)
    assert np.allclose(resting.tension, 1.0)
    assert np.allclose(resting.tip[1:], 0, atol=1e-15)


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


def test_the_static_residual_is_the_derivative_of_an_energy_without_followers_and_friction():
    """Elastic + gravitational energy, less the work of dead loads and of the tensions on their cables."""
    rod = rich_rod(loads=(), cables=RICH.cables[2:])
    q, given, force = coordinates(rod), np.array([2.0, 1e3]), np.array([0.1, -0.2, 0.3])

    def potential(q):
        lengths = values(rod.model.cable_lengths, q)
        work = force @ values(rod.tip, q) - given @ (lengths * [1.0, -1e-4])
        return float(rod.energy(np.concatenate([q, np.zeros(rod.dof)]))) - work

    tip_load = np.concatenate([np.zeros(3), force, np.zeros(6)])
    numeric = derivative(potential, q)
    assert np.allclose(residual(rod, q, given, tip_load), numeric, rtol=0, atol=1e-8 * np.abs(numeric).max())


@pytest.mark.parametrize("part", [1.02, 1.1, 1.5, 4.0])
@pytest.mark.parametrize("imperfection", [1e-2, 1e-3, 1e-4])
def test_a_column_buckles_to_the_side_to_which_it_is_pushed(part, imperfection):
    """Euler's column beyond pi^2 EI / (4 L^2); the tip is where the elastica of Timoshenko and Gere has it."""
    rod = Rod(0.6, Section.circle(0.02), Material(1e6, 0.5, 1000), Strain(bending_z=6))
    P = part * np.pi**2 / 4 * 1e6 * rod.divisions[0].section.Iz / 0.6**2
    bent = rod.equilibrium(tip_force=(-P, imperfection * P, 0))
    assert bent.stability > 0
    # tip angle alpha: sqrt(part) = 2 K(sin(alpha/2)) / pi, and deflection 4 sin(alpha/2) / (pi sqrt(part)) of L
    modulus = brentq(lambda k: 2 / np.pi * ellipk(k**2) - np.sqrt(part), 1e-9, 1 - 1e-12)
    perfect = 4 * modulus / (np.pi * np.sqrt(part)) * 0.6
    assert bent.tip[1] == pytest.approx(perfect, rel=1e-3 + 1.5 * imperfection / (part - 1))
    straight = rod.equilibrium(tip_force=(-P, 0, 0))
    assert np.allclose(straight.tip, [0.6, 0, 0], atol=1e-12)
    assert straight.stability == pytest.approx(1 - part, rel=1e-4, abs=1e-5)
