"""Small vibrations against beam theory, for a rod of radius 0.03 m and length 0.6 m."""

from dataclasses import replace
from math import pi, sqrt

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from socasadi.rod import Rod, Strain

PAPER = Rod.preset("paper")
TIMOSHENKO = (0.7331, 4.4448, 11.863)  # Hz, no shear correction, with rotary inertia
E, G, RHO, L, R = 1e6, 1e6 / 3, 1000.0, 0.6, 0.03


def bending_only(order: int, shear: int | None) -> np.ndarray:
    strain = Strain(bending_z=order, shear_y=shear)
    return replace(PAPER, strain=strain, quadrature_points=20).modes().frequency


def test_bending_converges_to_timoshenko_as_order_and_shear_are_added():
    errors = [abs(bending_only(order, shear)[0] - TIMOSHENKO[0]) for order, shear in [(1, None), (2, 0), (4, 4)]]
    assert errors[0] > 5 * errors[1] > 25 * errors[2]
    assert np.allclose(bending_only(7, 7)[:3], TIMOSHENKO, rtol=1e-4)


def test_a_long_rod_without_shear_is_an_euler_bernoulli_beam():
    long = replace(PAPER, length=60.0, strain=Strain(bending_y=8), quadrature_points=20)
    unit = sqrt(E * R**2 / (4 * RHO)) / (2 * pi * 60.0**2)
    expected = unit * np.array([1.875104, 4.694091, 7.854757]) ** 2
    assert np.allclose(long.modes().frequency[:3], expected, rtol=1e-4)


def test_torsion_and_axial_waves():
    strain = Strain(torsion=4, stretch=4)
    frequency = replace(PAPER, strain=strain, quadrature_points=8).modes().frequency
    assert frequency[0] == pytest.approx(sqrt(G / RHO) / (4 * L), rel=1e-5)  # 7.607 Hz
    assert frequency[1] == pytest.approx(sqrt(E / RHO) / (4 * L), rel=1e-5)  # 13.176 Hz


def test_the_preset_has_the_first_bending_frequency_within_one_percent_and_two_modes_an_axis():
    modes = PAPER.modes()
    assert np.allclose(modes.frequency[:2], TIMOSHENKO[0], rtol=0.01)
    assert np.allclose(modes.frequency[2:4], TIMOSHENKO[1], rtol=0.05)
    # Kelvin-Voigt: zeta = (3 eta / E) omega / 2 for bending
    assert np.allclose(modes.damping_ratio[:4], 3 * 1.1e4 / 1e6 * pi * modes.frequency[:4], rtol=1e-12)


def test_linearisation_has_the_modes_as_eigenvalues_and_the_static_gain():
    A, B, C, D = PAPER.linearise()
    modes = PAPER.modes()
    eigenvalues = np.linalg.eigvals(A)
    slow = np.sort(np.abs(eigenvalues[np.abs(eigenvalues.imag) > 1]))[0]
    assert slow == pytest.approx(2 * pi * modes.frequency[0], rel=1e-9)
    gain = D - C @ np.linalg.solve(A, B)
    h = 1e-3
    numeric = np.array([(PAPER.equilibrium(h * e).tip[1:] - PAPER.equilibrium(-h * e).tip[1:]) for e in np.eye(3)])
    assert np.allclose(gain, numeric.T / (2 * h), rtol=0, atol=1e-9)


def test_discrete_linearisation_holds_the_input_over_a_sample():
    equilibrium = PAPER.equilibrium([4.0, -1.0, 0.0])
    A, B, *_ = PAPER.linearise(equilibrium)
    Ad, Bd, *_ = PAPER.linearise(equilibrium, sample_time=0.05)
    x0, u = np.random.default_rng(0).normal(size=2 * PAPER.dof), np.array([1.0, -2.0, 0.5])
    end = solve_ivp(lambda _, x: A @ x + B @ u, (0, 0.05), x0, method="Radau", rtol=1e-9, atol=1e-11).y[:, -1]
    assert np.allclose(Ad @ x0 + Bd @ u, end, rtol=0, atol=1e-6)


def test_linearisation_predicts_small_motions_of_the_rod():
    equilibrium = PAPER.equilibrium([4.0, -1.0, 0.0])
    Ad, Bd, *_ = PAPER.linearise(equilibrium, sample_time=0.05)
    random, h = np.random.default_rng(1), 1e-5
    dx, du = h * random.normal(size=2 * PAPER.dof), h * random.normal(size=3)
    end = PAPER.reference_step(0.05)(equilibrium.state + dx, equilibrium.tension + du, np.zeros(3)).full()[:, 0]
    assert np.allclose(end - equilibrium.state, Ad @ dx + Bd @ du, rtol=0, atol=1e-3 * h)
