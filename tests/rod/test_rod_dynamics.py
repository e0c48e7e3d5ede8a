"""The equations of motion against Lagrange's, and the step function against tight-tolerance integration."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest

from socasadi.codegen import compiled
from socasadi.rod import Material, Rod, Strain

PAPER = Rod.preset("paper")
ALL_STRAINS = replace(
    PAPER,
    strain=Strain(bending_y=1, bending_z=1, torsion=0, stretch=0, shear_y=0, shear_z=0),
    gravity=(3.0, -9.81, 1.0),
    quadrature_points=4,
)


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
    assert np.allclose(ALL_STRAINS.mass(q).full(), mass, rtol=0, atol=1e-12)

    # Legendre polynomials are orthogonal: the integral of P_k^2 along the rod is L / (2 k + 1).
    section, length = ALL_STRAINS.divisions[0].section, ALL_STRAINS.length
    k = np.array([0, 0, 1, 0, 1, 0, 0, 0])
    moments = [section.Ix, section.Iy, section.Iy, section.Iz, section.Iz] + 3 * [section.area]
    elastic = np.array([1e6 / 3, 1e6, 1e6, 1e6, 1e6, 1e6, 1e6 / 3, 1e6 / 3])
    viscous = 1.1e4 * np.array([1, 3, 3, 3, 3, 3, 1, 1])
    expected = force[:, 0] + length / (2 * k + 1) * moments * (elastic * q + viscous * v)
    assert np.allclose(ALL_STRAINS.bias(q, v).full()[:, 0], expected, rtol=1e-9, atol=1e-9)


def test_mass_is_symmetric_positive_definite_in_large_bends():
    for seed in range(5):
        mass = PAPER.mass(5 * np.random.default_rng(seed).normal(size=PAPER.dof) * ([1] * 7 + [0.1])).full()
        assert np.array_equal(mass, mass.T)
        assert np.linalg.eigvalsh(mass)[0] > 0


def test_rhs_solves_the_equations_of_motion():
    random, n = np.random.default_rng(0), PAPER.dof
    x, u, f = 0.5 * random.normal(size=2 * n), np.array([5.0, -3.0, 1.0]), np.array([0.1, -0.2, 0.3])
    q, v = x[:n], x[n:]
    q[-1] *= 0.1
    gradient = ca.Function("work", [s := ca.SX.sym("q", n)], [ca.jacobian(PAPER.tip.expand()(s), s)])
    force = PAPER.actuation(q).full() @ u + gradient(q).full().T @ f - PAPER.bias(q, v).full()[:, 0]
    xdot = PAPER.forced_rhs(x, u, f).full()[:, 0]
    assert np.allclose(xdot[:n], v, atol=0)
    assert np.allclose(PAPER.mass(q).full() @ xdot[n:], force, rtol=0, atol=1e-9)
    assert np.array_equal(PAPER.rhs(x, u).full(), PAPER.forced_rhs(x, u, np.zeros(3)).full())


def run(step, x, tension, samples, tip_force=(0.0, 0.0, 0.0)):
    states = [np.asarray(x, dtype=float)]
    for _ in range(samples):
        states.append(step(states[-1], tension, tip_force).full()[:, 0])
    return np.array(states)


def test_tip_one_second_after_a_step_of_tension():
    zero, tension = np.zeros(2 * PAPER.dof), [5.0, 0.0, 0.0]
    end = run(PAPER.step(0.05), zero, tension, 20)[-1]
    exact = PAPER.reference_step(1.0)(zero, tension, np.zeros(3)).full()[:, 0]
    tips = [PAPER.tip(x[: PAPER.dof]).full() for x in (end, exact)]
    assert np.linalg.norm(tips[0] - tips[1]) < 5e-6  # m; a tenth of what is asked of it


def test_tip_during_a_disturbance():
    zero, tension, pulse = np.zeros(2 * PAPER.dof), [5.0, -3.0, 0.0], [0.0, 0.0, 0.2]
    end = run(PAPER.step(0.05), zero, tension, 6, pulse)[-1]
    exact = PAPER.reference_step(0.3)(zero, tension, pulse).full()[:, 0]
    tips = [PAPER.tip(x[: PAPER.dof]).full() for x in (end, exact)]
    assert np.linalg.norm(tips[0] - tips[1]) < 2e-5


def test_the_step_has_order_two():
    released, n = PAPER.equilibrium([5.0, -3.0, 0.0]).state, PAPER.dof
    exact = PAPER.reference_step(0.2)(released, np.zeros(3), np.zeros(3)).full()[:, 0]
    errors = [
        np.linalg.norm((PAPER.step_expression(0.2, h)(released, np.zeros(3), np.zeros(3)).full()[:, 0] - exact)[:n])
        for h in (0.005, 0.0025, 0.00125)
    ]
    assert errors[0] / errors[1] == pytest.approx(4, rel=0.15)
    assert errors[1] / errors[2] == pytest.approx(4, rel=0.1)


def test_energy_without_damping_and_gravity_is_conserved_to_the_order_of_the_method():
    free = replace(PAPER, material=replace(PAPER.divisions[0].material, damping=0.0))
    released = free.equilibrium([5.0, -3.0, 0.0]).state
    before = float(free.energy(released))
    drift = []
    for substep in (0.002, 0.001, 0.0005):
        end = run(free.step_expression(0.1, substep), released, np.zeros(3), 2)[-1]
        drift.append(abs(float(free.energy(end)) - before) / before)
    assert drift[-1] < 1e-4
    assert drift[0] / drift[1] > 3.5
    assert drift[1] / drift[2] > 3.5


def test_energy_only_falls_with_damping():
    released = PAPER.equilibrium([10.0, -8.0, 3.0]).state
    energies = [float(PAPER.energy(x)) for x in run(PAPER.step(0.05), released, np.zeros(3), 60)]
    assert (np.diff(energies) < 0).all()
    assert energies[-1] < 0.1 * energies[0]


@pytest.mark.parametrize(
    "material",
    [Material(1e8, 0.5, 1000.0, 1.1e4), Material(1e6, 0.5, 1.0, 1.1e4), Material(1e8, 0.3, 100.0, 0.0)],
)
def test_stiff_light_and_undamped_rods_stay_bounded_with_the_default_substep(material):
    rod = replace(PAPER, material=material)
    start = rod.equilibrium(material.young / 1e6 * np.array([10.0, -3.0, 0.0])).state
    before = float(rod.energy(start))
    end = run(rod.step_expression(0.05), start, np.zeros(3), 4)[-1]
    assert float(rod.energy(end)) < before * (1 + 1e-6)


def test_compiled_and_interpreted_agree():
    x = np.random.default_rng(0).normal(size=2 * PAPER.dof) * ([1] * 7 + [0.05] + [1] * 7 + [0.05])
    arguments = (x, [5.0, -3.0, 1.0], [0.1, 0.0, -0.1])
    for function in (PAPER.forced_rhs, PAPER.step_expression(0.05)):
        interpreted, machine = function(*arguments).full(), compiled(function)(*arguments).full()
        assert np.allclose(machine, interpreted, rtol=1e-10, atol=1e-10)
