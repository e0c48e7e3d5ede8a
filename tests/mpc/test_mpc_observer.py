"""The Kalman filter against scipy's Riccati equation and against the recursion of its covariance."""

import casadi
import numpy as np
import pytest
from scipy.linalg import block_diag, solve_discrete_are

from socasadi.model import Modal
from socasadi.mpc import DesignError, LinearMPC

THETA = np.array([4.6, 0.08, 6e-3, -3e-3, -3e-3, 5.2, 0.15, 0.5e-3, 5e-3, -5e-3])
SYSTEM = Modal().state_space(THETA, 0.05)
WITH_D = SYSTEM._replace(D=1e-3 * np.random.default_rng(3).normal(size=(2, 3)))
SPREAD = np.array([[4.0, 1.0], [1.0, 2.0]])
NOISES = {
    "as preset": {},
    "one a channel": {
        "measurement_noise": (1e-3, 3e-3),
        "input_noise": (0.1, 0.5, 2.0),
        "disturbance_noise": (1e-3, 1e-4),
    },
    "covariances": {
        "measurement_noise": 1e-6 * SPREAD,
        "input_noise": np.array([[1.0, -0.9, 0.0], [-0.9, 1.0, 0.0], [0.0, 0.0, 0.0]]),
        "disturbance_noise": 1e-7 * SPREAD[::-1, ::-1],
    },
    "a poor sensor": {"measurement_noise": 1e-2, "input_noise": 0.01, "disturbance_noise": 1e-5},
    "a good sensor": {"measurement_noise": 1e-5, "input_noise": 2.0, "disturbance_noise": 1e-3},
}


def covariance(noise, size):
    return np.asarray(noise) if np.ndim(noise) == 2 else np.diag(np.broadcast_to(noise, size) ** 2.0)


def covariances(mpc):
    return (
        covariance(mpc.input_noise, mpc.inputs),
        covariance(mpc.disturbance_noise, mpc.outputs),
        covariance(mpc.measurement_noise, mpc.outputs),
    )


def extended(mpc, system):
    """(x, d) with the disturbance at the outputs or, through the least-norm scaled input, at the inputs."""
    n, p = len(system.A), mpc.outputs
    if mpc.disturbance_model == "output":
        on_state, on_output = np.zeros((n, p)), np.eye(p)
    else:
        u_max = mpc.input_scale
        gain = system.C @ np.linalg.solve(np.eye(n) - system.A, system.B) + system.D
        push = np.diag(u_max) @ np.linalg.pinv(gain * u_max)
        on_state, on_output = system.B @ push, system.D @ push
    A = np.block([[system.A, on_state], [np.zeros((p, n)), np.eye(p)]])
    return A, np.vstack([system.B, np.zeros((p, mpc.inputs))]), np.hstack([system.C, on_output])


@pytest.mark.parametrize("noise", NOISES)
@pytest.mark.parametrize("model", ["output", "input"])
@pytest.mark.parametrize("system", [SYSTEM, WITH_D], ids=["without D", "with D"])
def test_the_gain_is_that_of_scipy(system, model, noise):
    """The output in terms of the state before, where process and sensor share the input's noise: a cross term."""
    mpc = LinearMPC(Modal(), disturbance_model=model, **NOISES[noise])
    A, B, C = extended(mpc, system)
    shaken, step, sensor = covariances(mpc)
    entry = np.block([[B, np.vstack([np.zeros((4, 2)), np.eye(2)])]])
    through = C @ entry + np.hstack([system.D, np.zeros((2, 2))])
    both = block_diag(shaken, step)
    process, cross, measured = entry @ both @ entry.T, entry @ both @ through.T, through @ both @ through.T + sensor
    P = solve_discrete_are(A.T, (C @ A).T, process, measured, s=cross)
    gain = np.linalg.solve(C @ A @ P @ (C @ A).T + measured, C @ A @ P @ A.T + cross.T).T
    assert np.allclose(mpc.design(system).gain, gain, rtol=1e-5, atol=1e-7 * np.abs(gain).max())


@pytest.mark.parametrize("noise", NOISES)
@pytest.mark.parametrize("model", ["output", "input"])
def test_the_gain_is_where_a_filter_from_no_knowledge_ends(model, noise):
    """Predict, correct, thousands of times, with the input's noise as a state, so that nothing is correlated."""
    mpc = LinearMPC(Modal(), disturbance_model=model, **NOISES[noise])
    A, B, C = extended(mpc, WITH_D)
    shaken, step, sensor = covariances(mpc)
    transition = block_diag(A, np.zeros((3, 3)))
    entry = np.vstack([B, np.eye(3)])
    process = entry @ shaken @ entry.T + block_diag(np.zeros((4, 4)), step, np.zeros((3, 3)))
    output = np.hstack([C, WITH_D.D])
    P = block_diag(np.eye(6), np.zeros((3, 3)))
    for _ in range(8000):
        P = transition @ P @ transition.T + process
        gain = np.linalg.solve(output @ P @ output.T + sensor, output @ P).T
        P = P - gain @ output @ P
        P = (P + P.T) / 2
    assert np.allclose(mpc.design(WITH_D).gain, gain[:6], rtol=1e-4, atol=1e-6 * np.abs(gain).max())


@pytest.mark.parametrize("bounds", [(-10, 10), (0, 10), ((-1, -20, -5), (2, 5, 40))])
def test_unknown_tensions_are_assumed_in_newtons_whatever_the_bounds(bounds):
    gain = LinearMPC(Modal(), input_bounds=bounds, input_noise=0.7).design(WITH_D).gain
    assert np.allclose(gain, LinearMPC(Modal(), input_noise=0.7).design(WITH_D).gain, rtol=1e-9)


@pytest.mark.parametrize("delay", [1, 3])
def test_inputs_on_their_way_are_known_and_not_corrected(delay):
    design, undelayed = (LinearMPC(Modal(), delay=q).design(WITH_D) for q in (delay, 0))
    queue = slice(4, 4 + 3 * (delay + 1))
    assert np.array_equal(design.gain[queue], np.zeros((3 * (delay + 1), 2)))
    assert np.array_equal(np.delete(design.gain, queue, axis=0), undelayed.gain)


@pytest.mark.parametrize("bounds", [(-10, 10), ((-1, -20, -5), (2, 5, 40))])
@pytest.mark.parametrize("delay", [0, 2])
@pytest.mark.parametrize("model", ["output", "input"])
def test_the_estimate_is_that_of_a_filter_written_out(bounds, delay, model):
    """With a measured disturbance, the third input, and a queue of the other two."""
    rng = np.random.default_rng(4)
    bounds = bounds if np.ndim(bounds) < 2 else tuple(side[:2] for side in bounds)
    mpc = LinearMPC(Modal(), input_bounds=bounds, delay=delay, disturbance_model=model, measured_disturbances=1)
    tensions = WITH_D._replace(B=WITH_D.B[:, :2], D=WITH_D.D[:, :2])
    A, B, C = extended(mpc, tensions)
    E, F = np.r_[WITH_D.B[:, 2], 0, 0], WITH_D.D[:, 2]
    controller, u, w = mpc.controller_for(WITH_D), np.array([0.5, -0.2]), 0.0
    gain = np.delete(controller.design.gain, slice(4, len(controller.design.gain) - 2), axis=0)
    controller.reset(u)
    x = np.r_[np.linalg.solve(np.eye(4) - WITH_D.A, tensions.B @ u), 0, 0]
    queue = [u] * (delay + 1)
    for _ in range(30):
        y = rng.uniform(-0.05, 0.05, 2)
        x = A @ x + B @ queue[0] + E * w
        x = x + gain @ (y - C @ x - tensions.D @ queue[0] - F * w)
        w = rng.normal()
        queue = [*queue[1:], controller.step(y, rng.uniform(-0.05, 0.05, 2), [w])]
        assert np.allclose(controller.estimate[0][:4], x[:4], rtol=0, atol=1e-10)
        assert np.allclose(controller.estimate[1], x[4:], rtol=0, atol=1e-10)


def test_a_sensor_without_any_noise_is_refused_and_an_input_without_noise_is_not():
    with pytest.raises(ValueError, match="measurement_noise must be positive definite"):
        LinearMPC(Modal(), measurement_noise=((1e-6, 1e-6), (1e-6, 1e-6)))
    LinearMPC(Modal(), input_noise=np.zeros((3, 3))).design(SYSTEM)


def test_a_disturbance_that_is_said_never_to_change_is_refused():
    """Its estimate would never be corrected: a steady error for good."""
    with pytest.raises(
        DesignError, match=r"the model gives no controller: its observer has a pole of magnitude 1\.0000"
    ):
        LinearMPC(Modal(), disturbance_noise=((1e-6, 0), (0, 0))).design(SYSTEM)


def test_the_gain_is_symbolic_in_the_model():
    """The gain moves with theta as finite differences say."""
    mpc = LinearMPC(Modal(), disturbance_model="input")
    theta = casadi.MX.sym("theta", 10)
    gain = mpc.formulation(theta=theta)["gain"]
    slope = casadi.Function("slope", [theta], [casadi.jacobian(casadi.vec(gain), theta)])(THETA).full()
    at = casadi.Function("gain", [theta], [casadi.vec(gain)])
    for i in range(10):
        step = 1e-5 * THETA[i] * np.eye(10)[i]
        wanted = (at(THETA + step) - at(THETA - step)).full().ravel() / (2e-5 * THETA[i])
        assert np.allclose(slope[:, i], wanted, rtol=1e-4, atol=1e-5 * np.abs(wanted).max())
