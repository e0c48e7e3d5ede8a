"""The equations of motion against Lagrange's, and their balance of power."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from rod_support import CIRCLE, SILICONE, UPWARDS, coordinates, rich_rod, values

from socasadi.rod import Cable, Chamber, DistributedLoad, Drag, Helix, Payload, PointLoad, Rod, Strain

PAPER = Rod.preset("paper")
ALL_STRAINS = replace(
    PAPER,
    strain=Strain(bending_y=1, bending_z=1, torsion=0, stretch=0, shear_y=0, shear_z=0),
    gravity=(3.0, -9.81, 1.0),
    quadrature_points=4,
)
RICH = rich_rod()


@pytest.fixture(scope="module")
def lagrange():
    """(q, v) -> (M, inertia and gravity) by plain automatic differentiation of the energies of the poses."""
    rod, n = ALL_STRAINS, ALL_STRAINS.dof
    q, v = ca.SX.sym("q", n), ca.SX.sym("v", n)
    pose = rod.pose.expand()
    nodes, weights = np.polynomial.legendre.leggauss(4)
    section, rho = rod.divisions[0].section, rod.divisions[0].material.density
    kinetic, potential = ca.SX(0), ca.SX(0)
    for node, weight in zip((nodes + 1) / 2 * rod.length, weights / 2 * rod.length, strict=True):
        g = pose(q, node)
        rate = ca.reshape(ca.jtimes(ca.vec(g), q, v), 4, 4)
        spin = g[:3, :3].T @ rate[:3, :3]
        omega = ca.vertcat(spin[2, 1], spin[0, 2], spin[1, 0])
        moments = ca.DM([section.Ix, section.Iy, section.Iz])
        kinetic += weight * rho / 2 * (section.area * ca.sumsqr(rate[:3, 3]) + ca.dot(moments, omega**2))
        potential -= weight * rho * section.area * ca.dot(ca.DM(rod.gravity), g[:3, 3])
    momentum = ca.gradient(kinetic, v)
    inertial = ca.jtimes(momentum, q, v) - ca.gradient(kinetic, q)
    return ca.Function("lagrange", [q, v], [ca.jacobian(momentum, v), inertial + ca.gradient(potential, q)])


@pytest.mark.parametrize("seed", range(3))
def test_mass_and_bias_are_lagranges(lagrange, seed):
    random = np.random.default_rng(seed)
    scale = np.array([2, 2, 2, 2, 2, 0.2, 0.2, 0.2])
    q, v = scale * random.normal(size=8), scale * random.normal(size=8)
    mass, force = (value.full() for value in lagrange(q, v))
    assert np.allclose(values(ALL_STRAINS.mass, q), mass, rtol=0, atol=1e-12)

    # Legendre polynomials are orthogonal: the integral of P_k^2 along the rod is L / (2 k + 1).
    section, length = ALL_STRAINS.divisions[0].section, ALL_STRAINS.length
    k = np.array([0, 0, 1, 0, 1, 0, 0, 0])
    moments = [section.Ix, section.Iy, section.Iy, section.Iz, section.Iz] + 3 * [section.area]
    elastic = np.array([1e6 / 3, 1e6, 1e6, 1e6, 1e6, 1e6, 1e6 / 3, 1e6 / 3])
    viscous = 1.1e4 * np.array([1, 3, 3, 3, 3, 3, 1, 1])
    expected = force[:, 0] + length / (2 * k + 1) * moments * (elastic * q + viscous * v)
    assert np.allclose(values(ALL_STRAINS.bias, q, v), expected, rtol=1e-9, atol=1e-9)


def test_a_rich_rods_inertia_is_lagranges_by_its_own_mass_matrix():
    """d/dt (M v) - grad (v' M v / 2) is the part of the bias that is quadratic in the rates; drag aside."""
    rod = replace(RICH, drag=None)
    q, v = coordinates(rod), coordinates(rod, 1, 2.0)
    s, w = ca.MX.sym("q", rod.dof), ca.MX.sym("v", rod.dof)
    momentum = rod.mass(s) @ w
    force = ca.jtimes(momentum, s, w) - ca.gradient(ca.bilin(rod.mass(s), w, w) / 2, s)
    expected = values(ca.Function("inertia", [s, w], [force]), q, v)
    even = (values(rod.bias, q, v) + values(rod.bias, q, -v)) / 2 - values(rod.bias, q, 0 * v)
    assert np.allclose(even, expected, rtol=0, atol=1e-11 * np.abs(expected).max())


@pytest.mark.parametrize("rod", [PAPER, RICH], ids=["paper", "rich"])
def test_mass_is_symmetric_positive_definite_in_large_bends(rod):
    for seed in range(5):
        mass = values(rod.mass, coordinates(rod, seed, 5.0))
        assert np.array_equal(mass, mass.T)
        assert np.linalg.eigvalsh(mass)[0] > 0


def test_kinetic_energy_is_that_of_all_velocities():
    """Slices of the rod and rigid bodies, by their twists; the rod's own quadrature is fine enough."""
    rod = rich_rod(quadrature_points=14)
    q, v = coordinates(rod), coordinates(rod, 1, 3.0)
    kinetic, start = 0.0, 0.0
    for division in rod.divisions:
        for a, b in ((0, 0.5), (0.5, 1)):
            nodes, weights = np.polynomial.legendre.leggauss(20)
            for x, weight in zip(a + (b - a) * (nodes + 1) / 2, (b - a) * weights / 2, strict=True):
                twist = values(rod.model.twist, q, v, start + x * division.length)
                section = division.section_at(x)
                moments = np.array([section.Ix, section.Iy, section.Iz] + 3 * [section.area])
                kinetic += weight * division.length * 1000.0 / 2 * moments @ twist**2
        start += division.length
    for body in rod.payloads:
        twist = values(rod.model.twist, q, v, body.s or rod.length)
        moving = twist[3:] + np.cross(twist[:3], body.offset)
        kinetic += (body.mass * moving @ moving + twist[:3] @ np.array(body.inertia) @ twist[:3]) / 2
    assert v @ values(rod.mass, q) @ v / 2 == pytest.approx(kinetic, rel=1e-6)


def test_twist_and_velocity_are_rates_of_the_pose():
    q, v, s, h = coordinates(RICH), coordinates(RICH, 1), 0.47, 1e-5
    pose = values(RICH.pose, q, s)
    rate = (values(RICH.pose, q + h * v, s) - values(RICH.pose, q - h * v, s)) / (2 * h)
    body = np.linalg.solve(pose, rate)
    twist = values(RICH.model.twist, q, v, s)
    assert np.allclose(twist, [body[2, 1], body[0, 2], body[1, 0], *body[:3, 3]], rtol=0, atol=1e-8)
    assert np.allclose(values(RICH.model.velocity, q, v, s), rate[:3, 3], rtol=0, atol=1e-8)


def test_rhs_solves_the_equations_of_motion():
    random, n = np.random.default_rng(0), PAPER.dof
    x, u, f = 0.5 * random.normal(size=2 * n), np.array([5.0, -3.0, 1.0]), np.array([0.1, -0.2, 0.3])
    q, v = x[:n], x[n:]
    q[-1] *= 0.1
    gradient = ca.Function("work", [s := ca.SX.sym("q", n)], [ca.jacobian(PAPER.tip.expand()(s), s)])
    force = values(PAPER.actuation, q) @ u + values(gradient, q).T @ f - values(PAPER.bias, q, v)
    xdot = values(PAPER.forced_rhs, x, u, f)
    assert np.allclose(xdot[:n], v, atol=0)
    assert np.allclose(values(PAPER.mass, q) @ xdot[n:], force, rtol=0, atol=1e-9)
    assert np.array_equal(values(PAPER.rhs, x, u), values(PAPER.forced_rhs, x, u, np.zeros(3)))


def test_forward_and_inverse_dynamics_undo_each_other():
    q, v, u = coordinates(RICH), coordinates(RICH, 1), np.array([2.0, 1.0, -1.0, 500.0])
    acceleration = values(RICH.model.forward_dynamics, q, v, u)
    assert np.allclose(values(RICH.rhs, np.concatenate([q, v]), u)[RICH.dof :], acceleration, rtol=1e-12)
    force = values(RICH.model.inverse_dynamics, q, v, acceleration)
    expected = values(RICH.actuation, q) @ u
    # Mass times acceleration cancels to the force: rounding scales with the larger.
    scale = np.abs(values(RICH.mass, q) @ acceleration).max() + np.abs(values(RICH.bias, q, v)).max()
    assert np.allclose(force, expected, rtol=0, atol=1e-12 * scale)
    still = values(RICH.model.inverse_dynamics, q, v, np.zeros(RICH.dof))
    assert np.allclose(still, values(RICH.bias, q, v), rtol=1e-12)


def test_a_load_at_the_tip_acts_through_the_tips_motion():
    """Also where a payload or nothing at all stops the recursion before the tip."""
    load = np.array([0.01, -0.02, 0.03, 0.1, 0.2, -0.3, 0.02, 0.01, -0.01, -0.2, 0.1, 0.3])
    for rod in (PAPER, RICH):
        n = rod.dof
        q, v = coordinates(rod), coordinates(rod, 1)
        x, u = np.concatenate([q, v]), np.ones(len(rod.cables))
        pushed = values(rod.model.loaded_rhs, x, u, load) - values(rod.rhs, x, u)
        force = values(rod.mass, q) @ pushed[n:]
        R = values(rod.pose, q, rod.length)[:3, :3]
        twists = np.array([values(rod.model.twist, q, e, rod.length) for e in np.eye(n)])
        wrench = np.concatenate([R.T @ load[:3], R.T @ load[3:6]]) + load[6:]
        assert np.allclose(force, twists @ wrench, rtol=0, atol=1e-10)


def power_of(rod, x, u):
    """Rate of change of the energy along the equations of motion."""
    symbol = ca.MX.sym("x", 2 * rod.dof)
    rate = ca.jtimes(rod.energy(symbol), symbol, rod.rhs(symbol, u))
    return float(ca.Function("power", [symbol], [rate])(x))


def test_energy_changes_by_the_power_of_inputs_loads_damping_and_drag():
    drag = Drag((0.5, 2.0), (3.0, 20.0), (0.001, 0.003))

    def sand(s):
        return (0.0, 0.1 * s, 0.2)

    rod = Rod(
        0.6,
        CIRCLE,
        SILICONE,
        Strain(bending_y=1, bending_z=1, torsion=0, stretch=0, shear_y=0, shear_z=1),
        (Cable(Helix(0.02, 0.5)), Cable((0.02, 0.0), friction=0.3), Chamber((0.0, 0.01), 1e-4, start=0.2)),
        gravity=(1.0, -2.0, -9.0),
        base_rotation=UPWARDS,
        payloads=(Payload(0.05, s=0.4, inertia=(1e-5, 2e-5, 3e-5), offset=(0.0, 0.02, 0.01)), Payload(0.02)),
        loads=(
            PointLoad((0.1, 0.2, 0.3), (0.01, 0.02, 0.03), s=0.25),
            PointLoad((0.3, -0.2, 0.1), (0.03, -0.02, 0.01), follower=True),
            DistributedLoad(sand),
            DistributedLoad((0.0, 0.3, 0.0), (0.02, 0.0, 0.0), follower=True),
        ),
        drag=drag,
        quadrature_points=7,
    )
    q, v, u = coordinates(rod), coordinates(rod, 1, 3.0), np.array([3.0, 5.0, 2e3])

    def motion(s):
        return values(rod.pose, q, s)[:3, :3], values(rod.model.twist, q, v, s)

    power = v @ values(rod.actuation, q) @ u - v @ rod.damping_matrix.full() @ v
    for load in rod.loads[:2]:
        R, twist = motion(load.s or rod.length)
        wrench = np.concatenate([load.moment, load.force])
        power += wrench @ (twist if load.follower else np.concatenate([R @ twist[:3], R @ twist[3:]]))
    nodes, weights = np.polynomial.legendre.leggauss(7)
    for s, weight in zip(0.3 * (nodes + 1), 0.3 * weights, strict=True):
        R, twist = motion(s)
        power += weight * (np.array(sand(s)) @ R @ twist[3:] + 0.3 * twist[4] + 0.02 * twist[0])
        across = np.hypot(twist[4], twist[5])
        power -= weight * (0.5 * twist[3] ** 2 + 3.0 * abs(twist[3]) ** 3 + 2.0 * across**2 + 20.0 * across**3)
        power -= weight * (0.001 * twist[0] ** 2 + 0.003 * (twist[1] ** 2 + twist[2] ** 2))
    assert power_of(rod, np.concatenate([q, v]), u) == pytest.approx(power, rel=1e-10)


def test_without_damping_and_inputs_the_equations_conserve_energy():
    rod = rich_rod(material=replace(SILICONE, damping=0.0), loads=(), drag=None)
    x = np.concatenate([coordinates(rod), coordinates(rod, 1, 3.0)])
    scale = float(rod.energy(x)) - float(rod.energy(0 * x))
    assert abs(power_of(rod, x, np.zeros(4))) < 1e-11 * scale * np.abs(x).max()


def test_energy_is_kinetic_elastic_and_gravitational():
    rod = Rod(0.6, CIRCLE, SILICONE, Strain(bending_z=0, stretch=0), gravity=(0, -9.81, 0), base_position=(0, 2, 0))
    weight = 1000 * np.pi * 0.03**2 * 0.6 * 9.81
    assert float(rod.energy(np.zeros(4))) == pytest.approx(2 * weight, rel=1e-12)
    held = replace(rod, payloads=(Payload(0.1, offset=(0, 0.5, 0)),))
    assert float(held.energy(np.zeros(4))) == pytest.approx(2 * weight + 0.1 * 9.81 * 2.5, rel=1e-12)
    stretched = 0.5 * 1e6 * np.pi * 0.03**2 * 0.01**2 * 0.6
    assert float(rod.energy([0, 0.01, 0, 0])) - 2 * weight == pytest.approx(stretched, rel=1e-9)
    moving = 0.5 * 1000 * np.pi * 0.03**2 * 0.6**3 / 3  # velocity s for a unit rate of stretch
    assert float(rod.energy([0, 0, 0, 1])) - 2 * weight == pytest.approx(moving, rel=1e-6)
