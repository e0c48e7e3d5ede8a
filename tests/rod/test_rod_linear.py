"""Linearisation: derivatives of the equations about loaded, bent equilibria."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from rod_support import derivative, rich_rod, values
from scipy.integrate import solve_ivp

from socasadi.rod import Drag, Rod

PAPER = Rod.preset("paper")
RICH = rich_rod(drag=None)
LOADED = RICH.equilibrium([2.0, 3.0, 1.0, 1e3], (0.05, -0.1, 0.1), follower_force=(-0.1, 0.1, 0.1))


def test_the_matrices_are_derivatives_at_a_bent_pose_under_follower_and_dead_loads():
    n = RICH.dof
    A, B, C, D = RICH.linearise(LOADED)
    state = derivative(lambda x: values(RICH.model.loaded_rhs, x, LOADED.input, LOADED.tip_load), LOADED.state)
    given = derivative(lambda u: values(RICH.model.loaded_rhs, LOADED.state, u, LOADED.tip_load), LOADED.input, 1e-2)
    output = derivative(lambda x: RICH.in_base_frame(values(RICH.tip, x[:n]))[1:], LOADED.state)
    assert np.allclose(A, state, rtol=0, atol=1e-8 * np.abs(state).max())
    assert np.allclose(B, given, rtol=0, atol=1e-8 * np.abs(given).max())
    assert np.allclose(C, output, rtol=0, atol=1e-9)
    assert np.array_equal(D, np.zeros((2, 4)))
    mass = RICH.mass(LOADED.q).full()
    assert np.allclose(A[n:, :n], -np.linalg.solve(mass, LOADED.stiffness), rtol=0, atol=1e-8 * np.abs(A).max())


def test_an_output_of_ones_own():
    x = ca.MX.sym("x", 2 * PAPER.dof)
    middle = ca.Function("middle", [x], [PAPER.pose(x[: PAPER.dof], 0.3)[:3, 3]])
    equilibrium = PAPER.equilibrium([4.0, -1.0, 0.0])
    C = PAPER.linearise(equilibrium, output=middle).C
    assert np.allclose(C, derivative(lambda x: values(middle, x), equilibrium.state), rtol=0, atol=1e-9)


def test_linearisation_has_the_modes_as_eigenvalues_and_the_static_gain():
    linear = PAPER.linearise()
    A, B, C, D = linear
    modes = PAPER.modes()
    eigenvalues = np.linalg.eigvals(A)
    slow = np.sort(np.abs(eigenvalues[np.abs(eigenvalues.imag) > 1]))[0]
    assert slow == pytest.approx(2 * np.pi * modes.frequency[0], rel=1e-9)
    gain = D - C @ np.linalg.solve(A, B)
    numeric = derivative(lambda u: PAPER.equilibrium(u).tip[1:], np.zeros(3), 1e-2)
    assert np.allclose(gain, numeric, rtol=0, atol=1e-9)
    assert linear.sample_time is None
    assert np.array_equal(linear.equilibrium.q, np.zeros(8))


def test_static_gain_at_a_loaded_pose():
    A, B, C, _ = RICH.linearise(LOADED)

    def held(u):
        loads = {"tip_force": LOADED.tip_load[3:6], "follower_force": LOADED.tip_load[9:]}
        return RICH.in_base_frame(RICH.equilibrium(u, **loads).tip)[1:]

    numeric = derivative(held, LOADED.input, 1e-2, order=2)
    assert np.allclose(-C @ np.linalg.solve(A, B), numeric, rtol=0, atol=1e-7 * np.abs(numeric).max())


def test_discrete_linearisation_holds_the_input_over_a_sample():
    equilibrium = PAPER.equilibrium([4.0, -1.0, 0.0])
    A, B, *_ = PAPER.linearise(equilibrium)
    Ad, Bd, *_ = PAPER.linearise(equilibrium, sample_time=0.05)
    x0, u = np.random.default_rng(0).normal(size=2 * PAPER.dof), np.array([1.0, -2.0, 0.5])
    end = solve_ivp(lambda _, x: A @ x + B @ u, (0, 0.05), x0, method="Radau", rtol=1e-9, atol=1e-11).y[:, -1]
    assert np.allclose(Ad @ x0 + Bd @ u, end, rtol=0, atol=1e-6)


def test_discrete_linearisation_is_the_derivative_of_the_step():
    rod = replace(PAPER, gravity=(0.0, 0.0, -9.81))
    force = np.array([0.0, 0.1, 0.2])
    equilibrium = rod.equilibrium([4.0, -1.0, 0.0], tip_force=force)
    Ad, Bd, *_ = rod.linearise(equilibrium, sample_time=0.02)
    x, u = ca.MX.sym("x", 16), ca.MX.sym("u", 3)
    end = rod.step_expression(0.02, 0.0005)(x, u, force)
    slopes = ca.Function("slopes", [x, u], [ca.jacobian(end, x), ca.jacobian(end, u)])
    stepped = [value.full() for value in slopes(equilibrium.state, equilibrium.input)]
    scale = np.concatenate([np.ones(8), 10 * np.ones(8)])  # rates are ten times their coordinates, about
    for exact, found in zip((Ad, Bd), stepped, strict=True):
        assert np.allclose(found / scale[:, None], exact / scale[:, None], rtol=0, atol=2e-4 * np.abs(exact).max())


def test_linearisation_predicts_small_motions_of_the_rod():
    equilibrium = PAPER.equilibrium([4.0, -1.0, 0.0])
    Ad, Bd, *_ = PAPER.linearise(equilibrium, sample_time=0.05)
    random, h = np.random.default_rng(1), 1e-5
    dx, du = h * random.normal(size=2 * PAPER.dof), h * random.normal(size=3)
    end = PAPER.reference_step(0.05)(equilibrium.state + dx, equilibrium.tension + du, np.zeros(3)).full()[:, 0]
    assert np.allclose(end - equilibrium.state, Ad @ dx + Bd @ du, rtol=0, atol=1e-3 * h)


def test_drag_at_rest_damps_as_its_linear_part():
    """The quadratic part has no slope at rest, the linear one has."""
    wet = replace(PAPER, drag=Drag(linear=(1.0, 5.0), quadratic=(3.0, 20.0)))
    equilibrium = wet.equilibrium([2.0, 3.0, 1.0])
    A = wet.linearise(equilibrium).A
    linear_only = replace(wet, drag=Drag(linear=(1.0, 5.0)))
    assert np.allclose(A, linear_only.linearise(equilibrium).A, rtol=0, atol=1e-9 * np.abs(A).max())
    # 5 N s/m^2 against rho A = 2.83 kg/m: for a normal motion every mode loses half of 5 / 2.83 per second more.
    dry = np.linalg.eigvals(PAPER.linearise(equilibrium).A)
    slowest = [values[np.argsort(np.abs(values - 4.5j))[:2]].real.mean() for values in (np.linalg.eigvals(A), dry)]
    assert slowest[0] - slowest[1] == pytest.approx(-5 / (2 * 2.827), rel=0.03)
