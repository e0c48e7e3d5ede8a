"""The exponential of a twist and its derivative are exact at zero, at small and at large angles."""

import casadi as ca
import numpy as np
import pytest
from rod_support import derivative
from scipy.linalg import expm

from socasadi.rod.mechanics import _se3 as se3

ANGLES = [0.0, 1e-9, 1e-4, 0.1, 0.9999, 1.0001, 3.1, 2 * np.pi, 20.0]


@pytest.fixture(scope="module")
def functions():
    twist = ca.SX.sym("twist", 6)
    R, p = se3.exponential(twist)
    D = se3.tangent(twist)
    pose = ca.blockcat([[R, p], [ca.SX(1, 3), 1]])
    outputs = [pose, D, se3.adjoint_algebra(twist), ca.jacobian(pose, twist), ca.jacobian(D, twist)]
    return ca.Function("se3", [twist], outputs)


def twist_of(angle, seed=0):
    random = np.random.default_rng(seed)
    axis = random.normal(size=3)
    return np.concatenate([angle * axis / np.linalg.norm(axis), random.normal(size=3)])


def matrix(twist):
    w, v = twist[:3], twist[3:]
    return np.array([[0, -w[2], w[1], v[0]], [w[2], 0, -w[0], v[1]], [-w[1], w[0], 0, v[2]], [0, 0, 0, 0]])


def small_adjoint(twist):
    w, v = (matrix(np.concatenate([part, np.zeros(3)]))[:3, :3] for part in (twist[:3], twist[3:]))
    return np.block([[w, np.zeros((3, 3))], [v, w]])


@pytest.mark.parametrize("angle", ANGLES)
def test_exponential_is_the_matrix_exponential(functions, angle):
    twist = twist_of(angle)
    assert np.allclose(functions(twist)[0].full(), expm(matrix(twist)), rtol=0, atol=2e-13)


@pytest.mark.parametrize("angle", ANGLES)
def test_tangent_is_the_integral_of_the_adjoint(functions, angle):
    # exp([[-ad, 1], [0, 0]]) holds the integral over t in [0, 1] of exp(-t ad): the body tangent operator.
    twist = twist_of(angle)
    ad = small_adjoint(twist)
    assert np.array_equal(functions(twist)[2].full(), ad)
    block = np.zeros((12, 12))
    block[:6, :6], block[:6, 6:] = -ad, np.eye(6)
    assert np.allclose(functions(twist)[1].full(), expm(block)[:6, 6:], rtol=0, atol=2e-13)


@pytest.mark.parametrize("angle", ANGLES)
def test_tangent_is_the_derivative_of_the_exponential(functions, angle):
    twist = twist_of(angle, seed=1)
    pose, D, _, slope, _ = (value.full() for value in functions(twist))
    for i in range(6):
        body = np.linalg.solve(pose, slope[:, i].reshape(4, 4, order="F"))
        assert np.allclose(body, matrix(D[:, i]), rtol=0, atol=1e-12)


@pytest.mark.parametrize("angle", [0.0, 1e-9, 0.1, 0.999, 1.001, 3.1, 20.0])
def test_second_derivatives_are_those_of_finite_differences(functions, angle):
    twist = twist_of(angle, seed=2)
    second = functions(twist)[4].full()

    def tangent(twist):  # by way of the matrix exponential, not of the formula under test
        block = np.zeros((12, 12))
        block[:6, :6], block[:6, 6:] = -small_adjoint(twist), np.eye(6)
        return expm(block)[:6, 6:].ravel(order="F")

    assert np.allclose(second, derivative(tangent, twist, 1e-3), rtol=0, atol=1e-9)


def test_derivatives_at_exactly_zero(functions):
    _, D, _, _, second = (value.full() for value in functions(np.zeros(6)))
    assert np.array_equal(D, np.eye(6))
    for i in range(6):  # D = 1 - ad/2 + ..., so its derivative along a twist is minus half that twist's ad
        direction = np.eye(6)[i]
        assert np.allclose(second[:, i].reshape(6, 6, order="F"), -small_adjoint(direction) / 2, rtol=0, atol=1e-16)


def test_adjoint_of_the_inverse_pose(functions):
    """Seen from the frame at (R, p) a twist X is g^-1 X g."""
    pose, other = functions(twist_of(1.3))[0].full(), twist_of(0.7, seed=4)
    turned = se3.into_frame(ca.SX(pose[:3, :3]), ca.SX(pose[:3, 3]), ca.SX(other))
    expected = np.linalg.solve(pose, matrix(other) @ pose)
    assert np.allclose(matrix(ca.evalf(turned).full()[:, 0]), expected, rtol=0, atol=1e-14)
