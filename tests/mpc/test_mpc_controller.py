"""The controller in closed loop, and its answer against the same problem written out in states, inputs and slacks."""

import casadi
import numpy as np
import pytest

from socasadi.model import Modal, StateSpace
from socasadi.mpc import LinearMPC

T = 0.05
THETA = np.array([4.6, 0.08, 6e-3, -3e-3, -3e-3, 5.2, 0.15, 0.5e-3, 5e-3, -5e-3])
SYSTEM = Modal().state_space(THETA, T)
WITH_D = SYSTEM._replace(D=1e-3 * np.random.default_rng(3).normal(size=(2, 3)))
WIDE = {"input_bounds": (-100, 100), "output_bounds": None}


def circle(t, radius=0.05, period=20.0):
    angle = 2 * np.pi * (np.asarray(t)[..., None] * T / period)
    return radius * np.concatenate([np.cos(angle), np.sin(angle)], axis=-1)


def written_out(mpc, system, samples):
    """The problem over `samples` in newtons and metres: (x, d, u before, reference) -> first input, largest slack.

    Constraints hold in the first N samples only. With as many samples as the horizon it is the problem without a
    terminal cost; with many, the samples beyond the horizon are what a terminal cost stands for.
    """
    n, m, p, N = len(system.A), mpc.inputs, mpc.outputs, mpc.horizon
    A, B, C, D = (casadi.DM(matrix) for matrix in system)
    Q, R = (casadi.DM(np.diag(np.broadcast_to(*of))) for of in ((mpc.Q, p), (mpc.R, m)))
    (u_lower, u_upper), u_max = mpc.input_limits, np.max(np.abs(mpc.input_limits), axis=0)
    problem = casadi.Opti("conic")
    X, U, S = problem.variable(n, samples + 1), problem.variable(m, samples), problem.variable(p, N)
    x, d, u_before, reference = (problem.parameter(*size) for size in ((n, 1), (p, 1), (m, 1), (p, N)))
    problem.subject_to(X[:, 0] == x)
    problem.subject_to(X[:, 1:] == A @ X[:, :-1] + B @ U)
    Y = C @ X[:, 1:] + D @ U + casadi.repmat(d, 1, samples)
    error = Y - casadi.horzcat(reference, casadi.repmat(reference[:, -1], 1, samples - N))
    change = U - casadi.horzcat(u_before, U[:, :-1])
    share = casadi.DM(np.diag(1 / u_max))
    weighed = {"literal": U, "normalised": share @ U, "rate": share @ change}[mpc.input_term]
    problem.subject_to(casadi.vec(u_lower - U[:, :N]) <= 0)
    problem.subject_to(casadi.vec(U[:, :N] - u_upper) <= 0)
    problem.subject_to(casadi.vec(S) >= 0)
    if mpc.output_limits is not None:
        problem.subject_to(casadi.vec(Y[:, :N] - mpc.output_limits[1] - S) <= 0)
        problem.subject_to(casadi.vec(mpc.output_limits[0] - Y[:, :N] - S) <= 0)
    cost = casadi.sum1(casadi.sum2(error * (Q @ error))) + casadi.sum1(casadi.sum2(weighed * (R @ weighed)))
    problem.minimize(cost + mpc.slack_weight * casadi.sumsqr(S))
    problem.solver("piqp", {"piqp": {"eps_abs": 1e-10, "eps_rel": 1e-10}})

    def solve(*values):
        for parameter, value in zip((x, d, u_before, reference), values, strict=True):
            problem.set_value(parameter, value)
        solution = problem.solve()
        return np.ravel(solution.value(U[:, 0])), np.max(solution.value(S))

    return solve


INPUT_TERMS = {"rate": {}, "normalised": {"input_term": "normalised"}, "literal": {"input_term": "literal", "R": 3e-4}}
CONSTRAINTS = {
    "free": WIDE,
    "tight": {"input_bounds": (-4, 4), "output_bounds": (-0.03, 0.03)},
    "pulling only": {"input_bounds": (0, 10), "output_bounds": (-0.02, 0.06)},
    "each its own": {
        "input_bounds": ((-1, -6, 0), (2, 3, 8)),
        "output_bounds": ((-0.03, -0.02), (0.02, 0.04)),
        "Q": (1e3, 3e3),
        "slack_weight": 1e4,
    },
}


@pytest.mark.parametrize(
    ("constraints", "term", "terminal"),
    [
        *[("tight", term, terminal) for term in INPUT_TERMS for terminal in ("riccati", None)],
        *[("each its own", term, "riccati") for term in INPUT_TERMS],
        ("free", "rate", "riccati"),
        ("free", "literal", None),
        ("pulling only", "rate", "riccati"),
        ("pulling only", "normalised", None),
    ],
)
def test_the_input_solves_the_problem_as_it_is_written(constraints, term, terminal):
    mpc = LinearMPC(Modal(), horizon=6, terminal=terminal, **INPUT_TERMS[term], **CONSTRAINTS[constraints])
    solve = written_out(mpc, WITH_D, 6 if terminal is None else 160)
    rng = np.random.default_rng(0)
    controller, u = mpc.controller_for(WITH_D), np.mean(mpc.input_limits, axis=0)
    controller.reset(u)
    at_bound, largest_slack = 0, 0.0
    for _ in range(4):
        before, reference = u, 0.06 * rng.normal(size=(6, 2))
        u = controller.step(0.04 * rng.normal(size=2), reference)
        expected, slack = solve(*controller.estimate, before, reference.T)
        assert np.allclose(u, expected, rtol=0, atol=1e-5 * mpc.input_scale.max())
        at_bound += np.isin(u, mpc.input_limits).any()
        largest_slack = max(largest_slack, slack)
    assert controller.info.fallbacks == 0
    assert (at_bound > 0) == (constraints != "free")
    assert (largest_slack > 1e-4) == (constraints != "free")


@pytest.mark.parametrize("term", INPUT_TERMS)
def test_without_active_constraints_the_horizon_does_not_matter(term):
    """The terminal cost is the rest of an endless horizon, so that where it begins makes no difference."""
    first = []
    for horizon in (1, 3, 15):
        controller = LinearMPC(Modal(), horizon=horizon, **WIDE, **INPUT_TERMS[term]).controller_for(WITH_D)
        controller.reset([3, -1, 0])
        first.append(controller.step([0.005, -0.01], [0.02, 0.01]))
    assert np.abs(first[0]).max() > 1
    assert np.allclose(first[0], first[2], rtol=1e-5, atol=1e-5)
    assert np.allclose(first[1], first[2], rtol=1e-5, atol=1e-5)


def test_without_a_terminal_cost_the_horizon_matters():
    first = [
        LinearMPC(Modal(), horizon=N, terminal=None, **WIDE).controller_for(SYSTEM).step([0, 0], [0.02, 0.01])
        for N in (3, 15)
    ]
    assert np.abs(first[0] - first[1]).max() > 0.1


def closed_loop(mpc, system, plant, reference, steps, disturbance=(0.0, 0.0), force=(0.0, 0.0, 0.0)):
    """Outputs and inputs of a noiseless linear plant under the controller made from `system`."""
    controller = mpc.controller_for(system)
    x, y, outputs, inputs = np.zeros(len(plant.A)), np.array(disturbance), [], []
    for t in range(steps):
        u = controller.step(y, reference(t))
        x = plant.A @ x + plant.B @ (u + force)
        y = plant.C @ x + plant.D @ (u + force) + disturbance
        outputs.append(y)
        inputs.append(u)
    assert controller.info.fallbacks == 0
    return np.array(outputs), np.array(inputs)


def with_gain(system, factor):
    return system._replace(B=factor * system.B, D=factor * system.D)


@pytest.mark.parametrize("terminal", ["riccati", None])
@pytest.mark.parametrize(
    ("system", "plant", "disturbance", "force"),
    [
        (SYSTEM, SYSTEM, (0.006, -0.004), (0, 0, 0)),
        (SYSTEM, SYSTEM, (0, 0), (1.0, -0.5, 0.3)),
        (with_gain(SYSTEM, 1.3), SYSTEM, (0, 0), (0, 0, 0)),
        (with_gain(SYSTEM, 0.7), SYSTEM, (0.006, -0.004), (1.0, -0.5, 0.3)),
        (SYSTEM, WITH_D, (0.006, -0.004), (1.0, -0.5, 0.3)),
        (WITH_D, with_gain(WITH_D, 1.3), (0, 0), (0, 0, 0)),
        (Modal().state_space(THETA * [1.3, 2, 1, 1, 1, 0.8, 1, 1, 1, 1], T), SYSTEM, (0, 0), (0.5, 0, 0)),
    ],
    ids=["disturbance", "force", "gain too high", "gain too low", "unmodelled D", "D too low", "frequency wrong"],
)
def test_nothing_constant_leaves_a_steady_error(system, plant, disturbance, force, terminal):
    mpc = LinearMPC(Modal(), terminal=terminal)
    reference = np.array([0.02, -0.01])
    outputs, inputs = closed_loop(mpc, system, plant, lambda _: reference, 600, disturbance, force)
    assert np.abs(outputs[-20:] - reference).max() < 1e-6
    assert np.abs(inputs[-1]).max() < 10


@pytest.mark.parametrize("term", ["normalised", "literal"])
def test_at_rest_the_input_is_the_one_of_least_stage_cost(term):
    settings = INPUT_TERMS[term]
    mpc = LinearMPC(Modal(), **settings)
    reference = np.array([0.03, 0.01])
    weight = np.sqrt(settings["R"]) if term == "literal" else 1 / 10
    gain = SYSTEM.C @ np.linalg.solve(np.eye(4) - SYSTEM.A, SYSTEM.B)
    stacked = np.vstack([np.sqrt(1e3) * gain, weight * np.eye(3)])
    best = np.linalg.lstsq(stacked, np.r_[np.sqrt(1e3) * reference, np.zeros(3)], rcond=None)[0]
    _, inputs = closed_loop(mpc, SYSTEM, SYSTEM, lambda _: reference, 400)
    assert np.abs(best).max() > 1
    assert np.allclose(inputs[-1], best, rtol=1e-5, atol=1e-6)


def test_an_unstable_model_is_stabilised():
    """The second axis swings up by itself, 0.5 rad/s faster than it is damped."""
    unstable = Modal().state_space([*THETA[:6], -0.1, *THETA[7:]], T)
    assert np.abs(np.linalg.eigvals(unstable.A)).max() > 1.02
    outputs, _ = closed_loop(LinearMPC(Modal()), unstable, unstable, lambda _: np.array([0.02, 0.02]), 400)
    assert np.abs(outputs[-20:] - 0.02).max() < 1e-6


def test_cables_that_only_pull_reach_the_reference():
    mpc = LinearMPC(Modal(), input_bounds=(0, 10))
    outputs, inputs = closed_loop(mpc, SYSTEM, SYSTEM, lambda _: np.array([-0.02, 0.02]), 400)
    assert inputs.min() >= 0
    assert np.abs(outputs[-20:] - [-0.02, 0.02]).max() < 1e-6


def test_a_preview_tracks_better_than_a_held_reference():
    mpc = LinearMPC(Modal())
    wanted = circle(np.arange(1, 401), period=5.0)
    held = closed_loop(mpc, SYSTEM, SYSTEM, lambda t: circle(t + 1, period=5.0), 400)[0]
    seen = closed_loop(mpc, SYSTEM, SYSTEM, lambda t: circle(t + 1 + np.arange(10), period=5.0), 400)[0]
    error_held, error_seen = (np.sqrt(np.mean(np.sum((y - wanted)[100:] ** 2, axis=1))) for y in (held, seen))
    assert error_seen < 0.2 * error_held


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
    held = np.array([2.0, -3.0, 0.5])
    gain = SYSTEM.C @ np.linalg.solve(np.eye(4) - SYSTEM.A, SYSTEM.B) + WITH_D.D
    controller.reset(held)
    for _ in range(10):
        assert np.allclose(controller.step(gain @ held, gain @ held), held, atol=1e-5)


def test_states_of_any_number_make_a_controller():
    """A model with one state more than the family's, a lag of the first output."""
    A = np.block([[SYSTEM.A, np.zeros((4, 1))], [SYSTEM.C[:1], np.array([[0.3]])]])
    system = StateSpace(A, np.vstack([SYSTEM.B, np.zeros((1, 3))]), np.hstack([SYSTEM.C, np.zeros((2, 1))]), SYSTEM.D)
    u = LinearMPC(Modal()).controller_for(system).step([0.0, 0.0], [0.02, 0.0])
    assert np.allclose(u, LinearMPC(Modal()).controller_for(SYSTEM).step([0.0, 0.0], [0.02, 0.0]), atol=1e-6)
