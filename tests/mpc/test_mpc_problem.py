"""The controller's answer against the same problem written out in states, inputs and slacks, solved by piqp."""

import casadi
import numpy as np
import pytest
from scipy.linalg import null_space

from socasadi.model import Modal
from socasadi.mpc import LinearMPC

T = 0.05
THETA = np.array([4.6, 0.08, 6e-3, -3e-3, -3e-3, 5.2, 0.15, 0.5e-3, 5e-3, -5e-3])
SYSTEM = Modal().state_space(THETA, T)
WITH_D = SYSTEM._replace(D=1e-3 * np.random.default_rng(3).normal(size=(2, 3)))
WIDE = {"input_bounds": (-100, 100), "output_bounds": None}


class WrittenOut:
    """The problem over `samples` in newtons and metres, with every state, input and slack a variable.

    Constraints hold in the first N samples, and the inputs are held in blocks there. With as many samples as the
    horizon it is the problem without a terminal cost; with many, the samples beyond are what a terminal cost stands
    for. The delay is a list of the inputs that were applied.
    """

    def __init__(self, mpc, system, samples):
        n, m, p, N, k = len(system.A), mpc.inputs, mpc.outputs, mpc.horizon, mpc.measured_disturbances
        A, C = casadi.DM(system.A), casadi.DM(system.C)
        B, E, D, F = (casadi.DM(block) for of in (system.B, system.D) for block in np.split(of, [m], axis=1))
        u_max = np.max(np.abs(mpc.input_limits), axis=0)
        share = casadi.DM(np.diag(1 / u_max))
        gain = (system.C @ np.linalg.solve(np.eye(n) - system.A, system.B) + system.D)[:, :m]
        problem = self.problem = casadi.Opti("conic")
        X, U, S = problem.variable(n, samples + 1), problem.variable(m, samples), problem.variable(p, N)
        given = {"x": (n, 1), "d": (p, 1), "before": (m, mpc.delay + 1), "reference": (p, N), "w": (k, 1)}
        self.given = {name: problem.parameter(*size) for name, size in given.items() if size[0]}
        x, d, before, reference = (self.given[name] for name in ("x", "d", "before", "reference"))
        w = self.given.get("w", casadi.DM(0, 1))
        acting = casadi.horzcat(before[:, 1:], U)[:, :samples]
        if mpc.disturbance_model == "input":
            pushed = casadi.DM(np.diag(u_max) @ np.linalg.pinv(gain * u_max)) @ d
            on_state, on_output = B @ pushed, D @ pushed
        else:
            on_state, on_output = casadi.DM.zeros(n), d
        every = casadi.DM.ones(1, samples)
        problem.subject_to(X[:, 0] == x)
        problem.subject_to(X[:, 1:] == A @ X[:, :-1] + B @ acting + (E @ w + on_state) @ every)
        Y = C @ X[:, 1:] + D @ acting + (F @ w + on_output) @ every
        error = Y - casadi.horzcat(reference, casadi.repmat(reference[:, -1], 1, samples - N))
        change = U - casadi.horzcat(before[:, -1], U[:, :-1])

        starts = np.cumsum([0, *mpc.blocks[:-1]])
        for j in range(N):
            if j not in starts:
                problem.subject_to(U[:, j] == U[:, j - 1])

        def between(limits, values, slack=None):
            for i, (lower, upper) in enumerate(zip(*limits, strict=True)):
                exceeded = 0 if slack is None else slack[i, :]
                if np.isfinite(lower):
                    problem.subject_to(casadi.vec(lower - values[i, :] - exceeded) <= 0)
                if np.isfinite(upper):
                    problem.subject_to(casadi.vec(values[i, :] - exceeded - upper) <= 0)

        between(mpc.input_limits, U[:, :N])
        if mpc.rate_bounds is not None:
            between(np.multiply(mpc.rate_limits, T), change[:, :N])
        problem.subject_to(casadi.vec(S) >= 0)
        if mpc.output_bounds is not None:
            reached = slice(mpc.delay, N)  # nothing can change the outputs before
            between(mpc.output_limits, Y[:, reached], S[:, reached])

        def weighed(values, weight, size):
            matrix = casadi.DM(weight * np.eye(size) if np.ndim(weight) < 1 else np.diag(weight))
            return casadi.sum1(casadi.sum2(values * (matrix @ values)))

        cost = weighed(error, mpc.Q, p) + weighed(share @ change, mpc.rate_weight, m)
        cost += weighed({"literal": U, "normalised": share @ U, "rate": share @ change}[mpc.input_term], mpc.R, m)
        if mpc.input_term == "rate":
            idle = null_space(gain * u_max)
            middle = share @ casadi.DM(np.mean(mpc.input_limits, axis=0)) @ every
            cost += 1e-4 * weighed(casadi.DM(idle @ idle.T) @ (share @ U - middle), mpc.R, m)
        cost += weighed(S, mpc.slack_weight, p)
        cost += casadi.sum1(casadi.sum2(casadi.DM(np.broadcast_to(mpc.slack_linear, p)).T @ S))
        problem.minimize(cost)
        problem.solver("piqp", {"piqp": {"eps_abs": 1e-10, "eps_rel": 1e-10}})
        self.u, self.slack, self.y = U[:, 0], casadi.mmax(S), Y

    def solve(self, **values):
        for name, parameter in self.given.items():
            self.problem.set_value(parameter, values[name])
        solution = self.problem.solve()
        return np.ravel(solution.value(self.u)), solution.value(self.slack)


INPUT_TERMS = {"rate": {}, "normalised": {"input_term": "normalised"}, "literal": {"input_term": "literal", "R": 3e-4}}
TIGHT = {"input_bounds": (-4, 4), "output_bounds": (-0.03, 0.03)}
EACH = {
    "input_bounds": ((-1, -6, 0), (2, 3, 8)),
    "output_bounds": ((-0.03, -0.02), (0.02, 0.04)),
    "Q": (1e3, 3e3),
    "R": (1.0, 2.0, 0.5),
    "slack_weight": (1e4, 3e4),
}
EVERYTHING = {
    **TIGHT,
    "control_horizon": (1, 2, 3),
    "preview": 4,
    "rate_weight": 0.5,
    "rate_bounds": (-40, 30),
    "slack_linear": 20.0,
    "disturbance_model": "input",
    "measured_disturbances": 1,
    "delay": 2,
}
CASES = {
    **{
        f"{term}, {end}": {**TIGHT, **INPUT_TERMS[term], "terminal": end}
        for term in INPUT_TERMS
        for end in ("riccati", None)
    },
    **{f"each its own, {term}": {**EACH, **INPUT_TERMS[term]} for term in ("rate", "normalised")},
    "free": WIDE,
    "free, literal": {**WIDE, **INPUT_TERMS["literal"], "terminal": None},
    "pulling only": {"input_bounds": (0, 10), "output_bounds": (-0.02, 0.06)},
    "pulling only, normalised": {"input_bounds": (0, 10), "output_bounds": (-0.02, 0.06), "input_term": "normalised"},
    "control horizon": {**TIGHT, "control_horizon": 2},
    "blocks": {**TIGHT, "control_horizon": (1, 3, 2), "terminal": None},
    "one move": {**TIGHT, "control_horizon": 1, "input_term": "normalised"},
    "preview": {**TIGHT, "preview": 2},
    "no preview": {**TIGHT, "preview": 1, "terminal": None},
    "rate weight": {**TIGHT, "rate_weight": (3.0, 1.0, 0.0), **INPUT_TERMS["normalised"]},
    "rate bounds": {**TIGHT, "rate_bounds": (-30, (40, 20, 30))},
    "a rate bound of one cable": {**TIGHT, "rate_bounds": (-np.inf, (np.inf, 20, np.inf)), "terminal": None},
    "linear slack": {**TIGHT, "slack_linear": 30.0},
    "linear slack of one output": {**TIGHT, "slack_linear": (0.0, 1e3), "slack_weight": (1e5, 1e3)},
    "one side bounded": {"input_bounds": (-4, 4), "output_bounds": ((-np.inf, -0.01), (0.02, np.inf))},
    "delay": {**TIGHT, "delay": 1},
    "long delay": {**TIGHT, "delay": 4, "terminal": None, **INPUT_TERMS["normalised"]},
    "delay, normalised": {**TIGHT, "delay": 3, **INPUT_TERMS["normalised"]},
    "measured disturbance": {**TIGHT, "measured_disturbances": 1},
    "two of them": {**TIGHT, "measured_disturbances": 2, **INPUT_TERMS["normalised"]},
    "input disturbance": {**TIGHT, "disturbance_model": "input"},
    "input disturbance, normalised": {**TIGHT, "disturbance_model": "input", **INPUT_TERMS["normalised"]},
    "everything": EVERYTHING,
    "everything without end": {**EVERYTHING, "terminal": None, "measured_disturbances": 0, "control_horizon": 4},
}


@pytest.mark.parametrize("name", CASES)
def test_the_input_solves_the_problem_as_it_is_written(name):
    mpc = LinearMPC(Modal(), **{"horizon": 6, **CASES[name]})
    # What hardly costs, as the common mode of the cables, or is hardly reached, comes to rest slowly.
    endless = 600 if mpc.input_term == "rate" or mpc.inputs < 2 else 160
    problem = WrittenOut(mpc, WITH_D, 6 if mpc.terminal is None else endless)
    rng, k = np.random.default_rng(0), mpc.measured_disturbances
    controller = mpc.controller_for(WITH_D)
    before = [np.mean(mpc.input_limits, axis=0)] * (mpc.delay + 1)
    controller.reset(before[0])
    at_bound, largest_slack = 0, 0.0
    for _ in range(5):
        reference, w = 0.06 * rng.normal(size=(6, 2)), 2 * rng.normal(size=k)
        u = controller.step(0.04 * rng.normal(size=2), reference, w if k else None)
        x, d = controller.estimate
        seen = reference[np.minimum(np.arange(6), mpc.reference_rows - 1)]
        expected, slack = problem.solve(x=x[:4], d=d, before=np.transpose(before), reference=seen.T, w=w)
        assert np.allclose(u, expected, rtol=0, atol=1e-5 * mpc.input_scale.max())
        before = [*before[1:], u]
        at_bound += np.isclose(u, mpc.input_limits, rtol=0, atol=1e-9).any()
        largest_slack = max(largest_slack, slack)
    assert controller.info.fallbacks == 0
    if "free" in name:
        assert at_bound == 0
    else:
        assert at_bound > 0 or mpc.rate_bounds is not None
        assert largest_slack > 1e-4


@pytest.mark.parametrize("delay", [0, 2])
@pytest.mark.parametrize("model", ["output", "input"])
@pytest.mark.parametrize("term", INPUT_TERMS)
def test_without_active_constraints_the_horizon_does_not_matter(term, model, delay):
    """The terminal cost is the rest of an endless horizon, so that where it begins makes no difference."""
    first = []
    for horizon in (3, 4, 15):
        mpc = LinearMPC(
            Modal(), horizon=horizon, **WIDE, **INPUT_TERMS[term], disturbance_model=model, delay=delay, rate_weight=0.3
        )
        controller = mpc.controller_for(WITH_D)
        controller.reset([3, -1, 0])
        controller.step([0.005, -0.01], [0.02, 0.01])
        first.append(controller.step([0.01, -0.01], [0.02, 0.01]))
    assert np.abs(first[0]).max() > 1
    assert np.allclose(first[0], first[2], rtol=1e-5, atol=1e-5)
    assert np.allclose(first[1], first[2], rtol=1e-5, atol=1e-5)


def test_without_a_terminal_cost_the_horizon_matters():
    first = [
        LinearMPC(Modal(), horizon=N, terminal=None, **WIDE).controller_for(SYSTEM).step([0, 0], [0.02, 0.01])
        for N in (3, 15)
    ]
    assert np.abs(first[0] - first[1]).max() > 0.1


def test_a_linear_weight_above_what_a_bound_is_worth_keeps_it_exactly():
    """An exact penalty (Fletcher): no bound is exceeded that can be kept; a quadratic one always gives a little."""
    reference, limits = np.array([0.05, 0.0]), {"input_bounds": (-10, 10), "output_bounds": (-0.03, 0.03)}
    overshoot = {}
    for price in (0.0, 1e4):
        controller = LinearMPC(Modal(), slack_weight=1e3, slack_linear=price, **limits).controller_for(SYSTEM)
        x, y, outputs = np.zeros(4), np.zeros(2), []
        for _ in range(200):
            x = SYSTEM.A @ x + SYSTEM.B @ controller.step(y, reference)
            y = SYSTEM.C @ x
            outputs.append(y)
        overshoot[price] = np.max(outputs) - 0.03
    assert overshoot[0.0] > 5e-3
    assert overshoot[1e4] < 1e-6
