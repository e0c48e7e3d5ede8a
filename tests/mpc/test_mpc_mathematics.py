"""Riccati equation, steady target and condensing, each against scipy or a plain simulation."""

import casadi
import numpy as np
import pytest
from scipy.linalg import block_diag, solve_discrete_are
from scipy.optimize import LinearConstraint, minimize

from socasadi.model import Modal, StateSpace
from socasadi.mpc import DesignError, LinearMPC
from socasadi.mpc.formulation._condense import predict
from socasadi.mpc.formulation._riccati import riccati
from socasadi.mpc.formulation._target import steady_target

THETA = np.array([4.6, 0.08, 6e-3, -3e-3, -3e-3, 5.2, 0.15, 0.5e-3, 5e-3, -5e-3])
SYSTEM = Modal().state_space(THETA, 0.05)


def numbers(expressions):
    single = not isinstance(expressions, tuple)
    values = [casadi.evalf(e).full() for e in ([expressions] if single else expressions)]
    return values[0] if single else values


def MX(*arrays):
    return [casadi.MX(casadi.DM(array)) for array in arrays]


def random_system(rng, n=4, m=2, radius=1.1):
    A = rng.normal(size=(n, n))
    return A * radius / np.abs(np.linalg.eigvals(A)).max(), rng.normal(size=(n, m))


def random_cost(rng, n, m, rank):
    """Positive semidefinite weight of (x, u) with cross terms, positive definite in u."""
    factor = rng.normal(size=(rank, n + m))
    weight = factor.T @ factor + block_diag(np.zeros((n, n)), 0.1 * np.eye(m))
    return weight[:n, :n], weight[n:, n:], weight[:n, n:]


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("rank", [6, 1])
@pytest.mark.parametrize("radius", [0.9, 1.3])
def test_riccati_agrees_with_scipy(seed, rank, radius):
    rng = np.random.default_rng(seed)
    A, B = random_system(rng, radius=radius)
    Q, R, S = random_cost(rng, 4, 2, rank)
    ours = numbers(riccati(*MX(A, B, Q, R, S)))
    theirs = solve_discrete_are(A, B, Q, R, s=S)
    assert np.allclose(ours, theirs, rtol=1e-7, atol=1e-8 * np.abs(theirs).max())


def test_riccati_without_cross_terms_agrees_with_scipy():
    A, B = random_system(np.random.default_rng(1))
    assert np.allclose(
        numbers(riccati(*MX(A, B, np.eye(4), np.eye(2)))), solve_discrete_are(A, B, np.eye(4), np.eye(2)), rtol=1e-8
    )


def test_riccati_leaves_a_direction_alone_that_costs_nothing():
    """A state that stays by itself, is moved by the inputs and has no weight: no stabilising solution exists.

    The cost-to-go of a number of samples, from Bellman's recursion, rises towards the infinite one.
    """
    rng = np.random.default_rng(2)
    A, B = block_diag(random_system(rng, 3, 1, 0.8)[0], 1.0), rng.normal(size=(4, 2))
    Q, R = np.diag([1.0, 2.0, 0.0, 0.0]), np.eye(2)
    P = np.zeros((4, 4))
    for _ in range(3000):
        gain = np.linalg.solve(R + B.T @ P @ B, B.T @ P @ A)
        P = Q + A.T @ P @ (A - B @ gain)
    assert np.allclose(numbers(riccati(*MX(A, B, Q, R))), P, rtol=1e-8, atol=1e-9 * P.max())
    assert P[3, 3] < 1e-12


@pytest.mark.parametrize("seed", range(4))
def test_the_target_reaches_the_reference_nearest_to_the_middle_of_the_bounds(seed):
    rng = np.random.default_rng(seed)
    gain, wanted, centre = rng.normal(size=(2, 3)), rng.normal(size=2), rng.normal(size=3)
    v_0, slope = numbers(steady_target(*MX(gain, np.diag([1e3, 2e3]), np.zeros((3, 3))), casadi.DM(centre)))
    v = v_0.ravel() + slope @ wanted
    assert np.allclose(gain @ v, wanted, atol=1e-6)
    nearest = minimize(
        lambda z: np.sum((z - centre) ** 2), centre, constraints=LinearConstraint(gain, wanted, wanted), tol=1e-12
    )
    assert np.allclose(v, nearest.x, atol=1e-5)


def test_with_a_weight_on_the_input_the_target_is_the_least_stage_cost():
    rng = np.random.default_rng(5)
    gain, wanted, Q, R = rng.normal(size=(2, 3)), rng.normal(size=2), np.diag([3.0, 1.0]), np.diag([1.0, 2.0, 0.5])
    v_0, slope = numbers(steady_target(*MX(gain, Q, R), casadi.DM.zeros(3)))
    best = minimize(lambda v: (gain @ v - wanted) @ Q @ (gain @ v - wanted) + v @ R @ v, np.zeros(3), tol=1e-12)
    assert np.allclose(v_0.ravel() + slope @ wanted, best.x, atol=1e-6)


@pytest.mark.parametrize("horizon", [1, 2, 7])
def test_condensing_is_simulation(horizon):
    rng = np.random.default_rng(horizon)
    A, B = random_system(rng, 4, 3)
    C, D = rng.normal(size=(2, 4)), rng.normal(size=(2, 3))
    prediction = numbers(tuple(predict(*MX(A, B, C, D), horizon)))
    x0, inputs = rng.normal(size=4), rng.normal(size=(horizon, 3))
    x, outputs = x0, []
    for u in inputs:
        x = A @ x + B @ u
        outputs.append(C @ x + D @ u)
    free, forced, last_free, last_forced = prediction
    assert np.allclose(free @ x0 + forced @ inputs.ravel(), np.ravel(outputs), atol=1e-12)
    assert np.allclose(last_free @ x0 + last_forced @ inputs.ravel(), x, atol=1e-12)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"A": np.eye(4)}, "singular.*a pole at 1"),
        ({"B": np.zeros((4, 3))}, "singular"),
        ({"A": np.full((4, 4), np.nan)}, "its A, B, C or D is not finite"),
        ({"D": np.full((2, 3), np.inf)}, "its A, B, C or D is not finite"),
        (
            {"A": block_diag(SYSTEM.A[:2, :2], 1.2, 0.5), "C": np.eye(2, 4)},
            "unstable pole that the outputs do not show",
        ),
    ],
    ids=["integrator", "no effect", "NaN", "infinite D", "unstable and unobserved"],
)
def test_a_model_without_a_controller_is_named_as_such(change, said):
    with pytest.raises(DesignError, match=f"the model gives no controller: .*({said})"):
        LinearMPC(Modal()).controller_for(SYSTEM._replace(**change))


@pytest.mark.parametrize("name", StateSpace._fields)
def test_a_model_of_other_sizes_is_refused_by_name(name):
    with pytest.raises(ValueError, match=rf"{name} has shape \(5, 6\), but \(.*\) fits"):
        LinearMPC(Modal()).controller_for(SYSTEM._replace(**{name: np.ones((5, 6))}))
