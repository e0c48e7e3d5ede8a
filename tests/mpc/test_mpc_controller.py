"""The controller as an object: references, bounds to the last bit, resets, any number of states, compiled or not."""

from dataclasses import replace

import numpy as np
import pytest

from socasadi.model import Modal, StateSpace
from socasadi.mpc import LinearMPC

T = 0.05
THETA = np.array([4.6, 0.08, 6e-3, -3e-3, -3e-3, 5.2, 0.15, 0.5e-3, 5e-3, -5e-3])
SYSTEM = Modal().state_space(THETA, T)
WITH_D = SYSTEM._replace(D=1e-3 * np.random.default_rng(3).normal(size=(2, 3)))


def circle(t, radius=0.05, period=20.0):
    angle = 2 * np.pi * (np.asarray(t)[..., None] * T / period)
    return radius * np.concatenate([np.cos(angle), np.sin(angle)], axis=-1)


def first_input(reference):
    return LinearMPC(Modal()).controller_for(SYSTEM).step([0.001, 0.002], reference)


def test_a_short_preview_is_held_and_a_long_one_cut():
    rows = circle(np.arange(1, 11), period=5.0)
    assert np.array_equal(first_input(rows[0]), first_input(np.tile(rows[0], (10, 1))))
    assert np.array_equal(first_input(rows[:4]), first_input(np.vstack([rows[:4], np.tile(rows[3], (6, 1))])))
    assert np.array_equal(first_input(rows), first_input(np.vstack([rows, np.full((5, 2), 9.0)])))
    assert not np.allclose(first_input(rows), first_input(rows[:4]), atol=1e-3)


@pytest.mark.parametrize("seed", range(12))
def test_inputs_are_inside_the_bounds_to_the_last_bit(seed):
    rng = np.random.default_rng(seed)
    lower, upper = np.sort(rng.uniform(-9, 9, (2, 3)), axis=0)
    controller = LinearMPC(Modal(), input_bounds=(lower, upper)).controller_for(SYSTEM)
    at_bound = 0
    for _ in range(30):
        u = controller.step(rng.normal(scale=0.03, size=2), rng.normal(scale=0.1, size=2))
        assert (lower <= u).all()
        assert (u <= upper).all()
        at_bound += np.count_nonzero((u == lower) | (u == upper))
    assert at_bound > 10


def test_one_cable_and_one_output_make_a_controller():
    controller = LinearMPC(Modal(axes=1, inputs=1)).controller([5.0, 0.1, 5e-3])
    u = controller.step([0.0], [0.03])
    assert u.shape == (1,)
    assert 0 < u[0] <= 10


def test_a_reset_forgets():
    controller = LinearMPC(Modal()).controller(THETA)
    first = [controller.step([0.01, 0.0], [0.0, 0.02]) for _ in range(5)]
    controller.reset()
    assert controller.info.steps == 0
    assert np.array_equal(first, [controller.step([0.01, 0.0], [0.0, 0.02]) for _ in range(5)])


def test_a_robot_held_at_rest_is_left_there():
    """At the pose that the tensions before would hold, with that pose wanted, nothing has to change."""
    controller = LinearMPC(Modal()).controller_for(WITH_D)
    gain = SYSTEM.C @ np.linalg.solve(np.eye(4) - SYSTEM.A, SYSTEM.B) + WITH_D.D
    held = np.linalg.pinv(gain) @ [0.02, -0.03]
    controller.reset(held)
    for _ in range(10):
        assert np.allclose(controller.step(gain @ held, gain @ held), held, atol=1e-5)


def test_states_of_any_number_make_a_controller():
    """A model with one state more than the family's, a lag of the first output."""
    A = np.block([[SYSTEM.A, np.zeros((4, 1))], [SYSTEM.C[:1], np.array([[0.3]])]])
    system = StateSpace(A, np.vstack([SYSTEM.B, np.zeros((1, 3))]), np.hstack([SYSTEM.C, np.zeros((2, 1))]), SYSTEM.D)
    u = LinearMPC(Modal()).controller_for(system).step([0.0, 0.0], [0.02, 0.0])
    assert np.allclose(u, LinearMPC(Modal()).controller_for(SYSTEM).step([0.0, 0.0], [0.02, 0.0]), atol=1e-6)


def random_specification(rng):
    horizon, k = int(rng.integers(3, 12)), int(rng.integers(0, 2))
    settings = {
        "horizon": horizon,
        "input_bounds": (-4, 4),
        "output_bounds": (-0.03, 0.03),
        "measured_disturbances": k,
        "delay": int(rng.integers(0, 3)),
        "terminal": (None, "riccati")[rng.integers(2)],
        "input_term": ("rate", "normalised")[rng.integers(2)],
        "disturbance_model": ("output", "input")[rng.integers(2)],
        "rate_weight": (0.0, 1.0)[rng.integers(2)],
        "slack_linear": (0.0, 50.0, 5000.0)[rng.integers(3)],
        "rate_bounds": (None, (-30.0, (20.0, np.inf, 25.0)[: 3 - k]))[rng.integers(2)],
        "control_horizon": (None, int(rng.integers(1, horizon)))[rng.integers(2)],
        "preview": (None, int(rng.integers(1, horizon)))[rng.integers(2)],
    }
    return LinearMPC(Modal(), **settings)


@pytest.mark.parametrize("seed", range(12))
def test_the_compiled_controller_and_the_interpreted_one_are_the_same(seed):
    """Two derivations: the C solves the dual with rows made offline, the interpreted one the primal with slacks."""
    rng = np.random.default_rng(seed)
    mpc = random_specification(rng)
    system = WITH_D if seed % 2 else SYSTEM
    both = [replace(mpc, backend=name).controller_for(system) for name in ("active-set", "daqp")]
    for controller in both:
        controller.reset([2.0, -9.0, 1.0][: mpc.inputs])
    at_bound = 0
    for t in range(60):
        if t % 8 == 0:
            reference = rng.uniform(-0.06, 0.06, (4, 2))
        # Now and then a measurement that cannot be: both refuse it, and both know of it.
        y = np.array([1e9, 0.0]) if t % 20 == 10 else 0.03 * rng.normal(size=2)
        w = (rng.normal(size=1),) if mpc.measured_disturbances else ()
        one, other = (controller.step(y, reference, *w) for controller in both)
        assert np.allclose(one, other, rtol=0, atol=1e-8)
        assert np.allclose(both[0].estimate[0], both[1].estimate[0], rtol=0, atol=1e-9)
        at_bound += (np.abs(one) == 4).any()
    assert at_bound > 5 or mpc.rate_bounds is not None
    for controller in both:
        assert (controller.info.steps, controller.info.fallbacks, controller.info.refused) == (60, 0, 3)
