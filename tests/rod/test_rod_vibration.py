"""Small vibrations against beam theory, for a rod of radius 0.03 m and length 0.6 m."""

import itertools
from dataclasses import replace
from math import pi, sqrt

import numpy as np
import pytest
from rod_support import slender
from scipy.linalg import expm
from scipy.optimize import brentq

from socasadi.rod import Division, Drag, Material, Payload, Rod, Section, Strain

PAPER = Rod.preset("paper")
TIMOSHENKO = (0.7331, 4.4448, 11.863)  # Hz, no shear correction, with rotary inertia
EULER_BERNOULLI = (0.7373, 4.6207, 12.938)  # Hz
E, G, RHO, L, R = 1e6, 1e6 / 3, 1000.0, 0.6, 0.03
A, I = pi * R**2, pi * R**4 / 4  # noqa: E741


def timoshenko(guess: float, shear_correction: float = 1.0) -> float:
    """Hz, near ``guess``: roots of the frequency determinant of Timoshenko's beam, clamped and free."""

    def determinant(frequency):
        square = (2 * pi * frequency) ** 2
        slope = np.zeros((4, 4))  # of deflection, rotation, moment, shear force
        slope[0, 1], slope[0, 3], slope[1, 2] = 1, 1 / (shear_correction * G * A), 1 / (E * I)
        slope[2, 1], slope[2, 3], slope[3, 0] = -RHO * I * square, -1, -RHO * A * square
        return np.linalg.det(expm(L * slope)[2:, 2:])

    return brentq(determinant, 0.99 * guess, 1.01 * guess, xtol=1e-12)


def bending(order: int, shear: int | None, section: Section | None = None) -> np.ndarray:
    strain = Strain(bending_z=order, shear_y=shear)
    return (
        replace(PAPER, strain=strain, section=section or PAPER.divisions[0].section, quadrature_points=20)
        .modes()
        .frequency
    )


def test_bending_converges_to_timoshenko_as_order_and_shear_are_added():
    exact = [timoshenko(guess) for guess in TIMOSHENKO]
    assert np.allclose(exact, TIMOSHENKO, rtol=1e-4)
    errors = [abs(bending(order, shear)[0] - exact[0]) for order, shear in [(1, None), (2, 0), (3, 1), (4, 2)]]
    assert all(coarse > 5 * fine for coarse, fine in itertools.pairwise(errors))
    assert np.allclose(bending(7, 7)[:3], exact, rtol=5e-5)


def test_a_shear_correction_softens_as_timoshenko_has_it():
    section = replace(Section.circle(R), shear_correction=0.5)
    exact = timoshenko(timoshenko(0.7331) * 0.994, 0.5)
    assert bending(6, 6, section)[0] == pytest.approx(exact, rel=1e-5)


def test_a_long_rod_without_shear_is_an_euler_bernoulli_beam():
    long = replace(PAPER, length=60.0, strain=Strain(bending_y=8), quadrature_points=20)
    unit = sqrt(E * R**2 / (4 * RHO)) / (2 * pi * 60.0**2)
    expected = unit * np.array([1.875104, 4.694091, 7.854757]) ** 2
    assert np.allclose(long.modes().frequency[:3], expected, rtol=1e-4)
    assert np.allclose(1e4 * long.modes().frequency[:3], EULER_BERNOULLI, rtol=1e-4)


def test_torsion_and_axial_waves():
    strain = Strain(torsion=6, stretch=6)
    frequency = replace(PAPER, strain=strain, quadrature_points=12).modes().frequency
    torsion, axial = sqrt(G / RHO) / (4 * L), sqrt(E / RHO) / (4 * L)
    assert np.allclose([torsion, axial], [7.607, 13.176], rtol=1e-4)
    assert np.allclose(frequency[:3], [torsion, axial, 3 * torsion], rtol=2e-5)


def test_the_preset_has_the_first_bending_frequency_within_one_percent_and_two_modes_an_axis():
    modes = PAPER.modes()
    assert np.allclose(modes.frequency[:2], TIMOSHENKO[0], rtol=0.01)
    assert np.allclose(modes.frequency[2:4], TIMOSHENKO[1], rtol=0.05)
    # Kelvin-Voigt: zeta = (3 eta / E) omega / 2 for bending
    assert np.allclose(modes.damping_ratio[:4], 3 * 1.1e4 / 1e6 * pi * modes.frequency[:4], rtol=1e-12)


def test_mode_shapes_have_unit_modal_mass_and_diagonalise_the_stiffness():
    modes = PAPER.modes()
    mass, stiffness = PAPER.mass(np.zeros(8)).full(), PAPER.stiffness.full()
    assert np.allclose(modes.shape.T @ mass @ modes.shape, np.eye(8), rtol=0, atol=1e-9)
    squares = (2 * pi * modes.frequency) ** 2
    assert np.allclose(modes.shape.T @ stiffness @ modes.shape / squares, np.eye(8), rtol=0, atol=1e-9)


def test_a_tip_mass_on_a_light_beam():
    """sqrt(3 EI / (m L^3)); with rotary inertia J the two frequencies of the beam's tip compliance."""
    light = Section(1e-9, 1e-9, 1e-9)
    division = Division(1.0, light, Material(1.0, 0.5, 1.0), Strain(bending_z=1), stiffness=(1, 1, 1, 1, 1, 1))
    beam = Rod(divisions=division, payloads=(Payload(2.0),))
    assert 2 * pi * beam.modes().frequency[0] == pytest.approx(sqrt(3 / 2), rel=1e-6)
    heavy = replace(beam, payloads=(Payload(2.0, inertia=(0, 0, 0.5)),))
    compliance = np.array([[1 / 3, 1 / 2], [1 / 2, 1]])
    squares = 1 / np.sort(np.linalg.eigvals(compliance @ np.diag([2.0, 0.5])))[::-1]
    assert np.allclose(2 * pi * heavy.modes().frequency[:2], np.sqrt(squares), rtol=1e-6)
    # The same body with its centre of mass a = 0.4 beyond the tip.
    beyond = replace(beam, payloads=(Payload(2.0, inertia=(0, 0, 0.5), offset=(0.4, 0, 0)),))
    mass = np.array([[2.0, 2.0 * 0.4], [2.0 * 0.4, 0.5 + 2.0 * 0.4**2]])
    squares = 1 / np.sort(np.linalg.eigvals(compliance @ mass))[::-1]
    assert np.allclose(2 * pi * beyond.modes().frequency[:2], np.sqrt(squares), rtol=1e-6)


def test_a_bob_on_a_soft_hinge_is_a_pendulum():
    """A heavy bob on a stiff, light rod with a soft hinge-like first millimetre swings with sqrt(g / length)."""
    light, straight = Section(1e-9, 1e-9, 1e-9), Strain(bending_z=0)
    soft = Division(0.001, light, Material(1.0, 0.5, 1.0), straight, stiffness=[1, 1, 1e-6, 1, 1, 1])
    stiff = replace(soft, length=0.999, stiffness=[1, 1, 1e6, 1, 1, 1])
    pendulum = Rod(divisions=(soft, stiff), gravity=(9.81, 0, 0), payloads=(Payload(2.0),))
    # Turned by t, the soft division of length h ends at (h sin(t) / t, h t / 2) and resists with EI t / h: the bob
    # rises by (1 - h + h / 3) t^2 / 2 and moves by (1 - h / 2) t.
    square = (9.81 * (1 - 2 * 0.001 / 3) + 1e-6 / 0.001 / 2.0) / (1 - 0.001 / 2) ** 2
    assert 2 * pi * pendulum.modes().frequency[0] == pytest.approx(sqrt(square), rel=1e-8)


def test_an_unstable_mode_has_frequency_zero():
    upright = slender(Strain(bending_z=4), gravity=(-8.5e-6, 0, 0), quadrature_points=12)
    frequency = upright.modes().frequency
    assert frequency[0] == 0
    assert frequency[1] > 0


def test_material_and_drag_damp_a_mode_as_textbooks_have_it():
    """Kelvin-Voigt viscosity gives 3 eta omega / (2 E), drag proportional to the mass c / (2 rho A omega)."""
    thin = Rod(1.0, Section.circle(1e-3), Material(1e6, 0.5, 1000.0, damping=20.0), Strain(bending_z=4))
    modes = thin.modes()
    omega = 2 * pi * modes.frequency[:2]
    assert np.allclose(modes.damping_ratio[:2], 3 * 20.0 * omega / (2 * 1e6), rtol=1e-9)
    wet = replace(thin, material=Material(1e6, 0.5, 1000.0), drag=Drag(linear=(0.0, 2e-4), quadratic=(0.0, 5.0)))
    # rotary inertia, of which drag knows nothing, is (r / L)^2 of the rest
    assert np.allclose(wet.modes().damping_ratio[:2], 2e-4 / (2 * 1000 * pi * 1e-6 * omega), rtol=1e-4)
