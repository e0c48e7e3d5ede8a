"""How fast answers converge: in the order and pieces of a basis, in quadrature points and in the time step."""

from functools import cache

import numpy as np
import pytest
from rod_support import silicone_rod, slender, values
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from socasadi.rod import BSpline, Rod, Strain, piecewise_constant, piecewise_linear

LOAD = 5.0  # P L^2 / EI
TWISTED = Strain(bending_y=3, bending_z=3, torsion=2)


def slopes(sizes, errors) -> np.ndarray:
    return np.diff(np.log(errors)) / np.diff(np.log(sizes))


@cache
def elastica():
    """(x, y, angle, curvature) along a cantilever under a dead tip load, by shooting."""

    def shoot(curvature):
        right = lambda _, y: [np.cos(y[2]), np.sin(y[2]), y[3], -LOAD * np.cos(y[2])]  # noqa: E731
        start = [0, 0, 0, curvature]
        return solve_ivp(right, (0, 1), start, method="DOP853", rtol=1e-12, atol=1e-13, dense_output=True)

    return shoot(brentq(lambda curvature: shoot(curvature).y[3, -1], 1, LOAD, xtol=1e-13)).sol


def errors(basis, points):
    """Of the tip, and of the curvature along the rod, root mean square."""
    rod = slender(Strain(bending_z=basis), quadrature_points=points)
    bent = rod.equilibrium(tip_force=(0, LOAD, 0))
    places = np.linspace(0, 1, 101)
    curvature = np.array([values(rod.model.strain, bent.q, s)[2] for s in places])
    tip = np.linalg.norm(bent.tip[:2] - elastica()(1.0)[:2])
    return tip, np.sqrt(np.mean((curvature - elastica()(places)[3]) ** 2))


def test_legendre_polynomials_converge_faster_than_any_power():
    tip = np.array([errors(order, 60)[0] for order in (0, 2, 4, 6)])
    assert tip[-1] < 1e-8
    assert (tip[:-1] > 50 * tip[1:]).all()


@pytest.mark.parametrize(
    ("basis", "pieces", "rate"),
    [
        (piecewise_constant, (2, 4, 8, 16), 1),
        (piecewise_linear, (2, 4, 8), 2),
        (lambda pieces: BSpline(2, pieces), (2, 4, 8), 3),
    ],
    ids=["constant", "linear", "quadratic"],
)
def test_splines_have_their_order_in_the_strain_and_twice_that_at_the_tip(basis, pieces, rate):
    """Strain is approximated to h^(degree + 1); the tip's work is an energy, in which a Galerkin error is squared."""
    tip, strain = np.array([errors(basis(n), max(3, 64 // n)) for n in pieces]).T
    assert slopes(pieces, strain)[-1] == pytest.approx(-rate, abs=0.1)
    assert slopes(pieces, tip)[-1] == pytest.approx(-2 * rate, abs=0.15)


def test_kinematics_have_order_four_in_the_quadrature_points():
    points = np.array([8, 16, 32])
    rods = [slender(TWISTED, quadrature_points=n) for n in (*points.tolist(), 96)]
    q = 2 * np.random.default_rng(0).normal(size=rods[0].dof)

    def slope(s, state):  # R' = R kappa^, p' = R sigma
        R, xi = state[:9].reshape(3, 3), values(rods[0].model.strain, q, s)
        kappa = np.array([[0, -xi[2], xi[1]], [xi[2], 0, -xi[0]], [-xi[1], xi[0], 0]])
        return np.concatenate([(R @ kappa).ravel(), R @ xi[3:]])

    start = np.concatenate([np.eye(3).ravel(), np.zeros(3)])
    exact = solve_ivp(slope, (0, 1), start, method="DOP853", rtol=1e-12, atol=1e-13).y[9:, -1]
    tip = [np.linalg.norm(values(rod.tip, q) - exact) for rod in rods[:3]]
    assert slopes(points, tip) == pytest.approx([-4, -4], abs=0.35)
    assert np.linalg.norm(values(rods[3].tip, q) - exact) < 2e-8
    mass = [np.abs(values(rod.mass, q) - values(rods[3].mass, q)).max() for rod in rods[:3]]
    assert slopes(points, mass) == pytest.approx([-4, -4], abs=0.35)


def test_six_points_are_enough_for_a_tenth_of_a_millimetre():
    """A bend of a right angle: the default points against ten times as many."""
    coarse, fine = (silicone_rod(Strain(bending_y=2, bending_z=2), quadrature_points=n) for n in (None, 60))
    loads = {"tip_force": (0, 0.3, -3.0)}
    assert np.linalg.norm(fine.equilibrium(**loads).tip[1:]) > 0.25
    assert np.linalg.norm(coarse.equilibrium(**loads).tip - fine.equilibrium(**loads).tip) < 1e-4


def test_the_step_has_order_two_in_time():
    rod = Rod.preset("paper")
    released, u, force = rod.equilibrium([5.0, -3.0, 0.0]).state, [0.0, 2.0, 0.0], [0.0, 0.0, 0.1]
    exact = values(rod.reference_step(0.2), released, u, force)
    steps = np.array([0.005, 0.0025, 0.00125])
    ends = np.array([values(rod.step_expression(0.2, h), released, u, force) for h in steps])
    n = rod.dof
    for part in (slice(0, n), slice(n, 2 * n)):
        error = np.linalg.norm((ends - exact)[:, part], axis=1)
        assert slopes(steps, error) == pytest.approx([2, 2], abs=0.2)


def test_collocation_agrees_with_cvodes_and_gets_there_quickly():
    rod = Rod.preset("paper")
    start, u, force = np.zeros(2 * rod.dof), [5.0, -3.0, 0.0], [0.0, 0.0, 0.2]
    exact = values(rod.reference_step(0.05), start, u, force)
    error = [
        np.abs(values(rod.reference_step(0.05, "collocation", elements=n), start, u, force) - exact).max()
        for n in (5, 20)
    ]
    assert error[1] < 1e-6
    assert error[1] < error[0]
