"""Conditions are facts about a theta's controller that no experiment is needed for."""

from dataclasses import replace

import numpy as np
import pytest

from socasadi import Circle, Dense, LinearMPC, Modal, Study
from socasadi.campaign import ClosedLoopStability, IterationBound
from socasadi.campaign.experiment import admissible
from socasadi.codegen import c_compiler
from socasadi.model import StateSpace

with_compiler = pytest.mark.skipif(c_compiler() is None, reason="no C compiler")

MPC = LinearMPC(Modal())
THETA = np.array([4.6, 0.08, 0.0057, -0.0028, -0.0028, 4.6, 0.08, 0.0, 0.0049, -0.0049])


def simulated_radius(mpc, theta, factor):
    """Growth a sample of the loop's deviation from rest, seen by letting the controller step against a linear robot."""
    A, B, C, D = mpc.model.state_space(theta, mpc.sample_time)
    # So small that no bound is ever active.
    controller, x, u, sizes = mpc.controller(theta), np.full(len(A), 1e-7), np.zeros(3), []
    for _ in range(300):
        y = factor * (C @ x + D @ u)
        u = controller.step(y, np.zeros(2))
        x = A @ x + B @ u
        sizes.append(np.linalg.norm(x))
    return (sizes[-1] / sizes[-101]) ** (1 / 100)


def test_the_loop_is_called_stable_exactly_where_its_simulation_settles():
    limit = MPC.controller(THETA).analysis().gain_margin[1]
    inside, outside = 0.95 * limit, 1.05 * limit
    assert ClosedLoopStability(gain_margin=inside).margin(MPC, THETA) >= 0
    assert ClosedLoopStability(gain_margin=outside).margin(MPC, THETA) < 0
    assert simulated_radius(MPC, THETA, inside) < 1
    assert simulated_radius(MPC, THETA, outside) > 1


KINDS = {
    "plain": (MPC, THETA),
    "late": (replace(MPC, delay=2, rate_bounds=(-40, 40), disturbance_model="input"), THETA),
    "blocked": (replace(MPC, control_horizon=(1, 2, 7), terminal=None), THETA),
    "told": (LinearMPC(Modal(inputs=4), measured_disturbances=1), np.array([*THETA[:5], 0.01, *THETA[5:], -0.02])),
}


@pytest.mark.parametrize("kind", KINDS)
def test_its_margin_is_what_the_analysis_says_of_the_spectral_radius(kind):
    mpc, theta = KINDS[kind]
    system, controller = mpc.model.state_space(theta, mpc.sample_time), mpc.controller(theta)

    def radius(factor):
        plant = StateSpace(system.A, system.B, factor * system.C, factor * system.D)
        return controller.analysis(plant).spectral_radius

    largest = max(radius(2.5**power) for power in (-1, -0.5, 0, 0.5, 1))
    assert ClosedLoopStability(gain_margin=2.5).margin(mpc, theta) == pytest.approx(0.999 - largest, abs=1e-9)
    nominal = controller.analysis().spectral_radius
    assert ClosedLoopStability(gain_margin=1.0).margin(mpc, theta) == pytest.approx(0.999 - nominal, abs=1e-6)


def test_a_slow_loop_misses_a_smaller_radius():
    assert ClosedLoopStability(radius=0.999).margin(MPC, THETA) > 0 > ClosedLoopStability(radius=0.9).margin(MPC, THETA)


@with_compiler
def test_the_iteration_bound_is_what_the_compiled_controller_needs_and_no_less():
    needed = next(limit for limit in range(1, 200) if IterationBound(limit).margin(MPC, THETA) >= 0)
    assert needed > 1
    assert IterationBound(needed).margin(MPC, THETA) == 0
    assert IterationBound(needed + 5).margin(MPC, THETA) == 5
    # A solver that may change its working set no more often than it needs to solves every sample.
    controller = replace(MPC, iteration_limit=needed).controller(THETA)
    from socasadi.export import ControllerRecord

    record = ControllerRecord.simulated(MPC, MPC.model.state_space(THETA, 0.05), samples=1)
    for held, sample in record.random_samples(200):
        if held is not None:
            controller.reset(held)
        controller.step(*sample)
        assert controller.info.status == 0


@pytest.mark.parametrize("condition", [ClosedLoopStability(2.7), pytest.param(IterationBound(35), marks=with_compiler)])
def test_every_asking_gives_the_same_answer(condition):
    random = np.random.default_rng(1)
    thetas = THETA * random.uniform(0.8, 1.2, (10, 10))
    first = [condition.margin(MPC, theta) for theta in thetas]
    assert first == [condition.margin(MPC, theta) for theta in reversed(thetas)][::-1]
    assert min(first) < max(first)


def test_a_theta_without_a_controller_meets_no_condition():
    dense = LinearMPC(Dense(order=2))
    holds = admissible((ClosedLoopStability(),), dense)
    assert holds is not None
    assert not holds(np.zeros(dense.model.size))
    assert admissible((), dense) is None


def test_a_campaign_tries_only_what_meets_the_conditions(toy_study, tmp_path):
    condition = ClosedLoopStability(gain_margin=2.6)
    study = replace(toy_study, conditions=(condition,), seed_points=8, iterations=2)
    asked = [trial.theta for trial in study.run(tmp_path / "run", progress=None).trials]
    free = [t.theta for t in replace(study, conditions=()).run(tmp_path / "free", progress=None).trials]
    assert min(condition.margin(study.mpc, theta) for theta in free) < 0
    assert min(condition.margin(study.mpc, theta) for theta in asked) >= 0


def test_conditions_survive_the_run_folder(toy_study):
    conditions = (ClosedLoopStability(1.5), IterationBound(40))
    study = replace(toy_study, conditions=conditions, task=Circle())
    assert Study.from_settings(study.settings).conditions == conditions


@pytest.mark.parametrize(
    ("make", "error", "words"),
    [
        (lambda s: ClosedLoopStability(gain_margin=0.5), ValueError, "gain_margin is a factor of at least 1, not 0.5"),
        (lambda s: ClosedLoopStability(radius=1.0), ValueError, "radius .* between 0 and 1, not at 1.0"),
        (lambda s: IterationBound(0), ValueError, "limit of IterationBound is a positive integer, not 0"),
        (lambda s: replace(s, conditions=(ClosedLoopStability,)), TypeError, "a condition has name and margin"),
        (
            lambda s: replace(s, conditions=(ClosedLoopStability(), ClosedLoopStability(3.0))),
            ValueError,
            "two conditions .* called 'closed_loop_stability'",
        ),
        (
            lambda s: replace(s, mpc=replace(MPC, backend="daqp"), conditions=(IterationBound(9),)),
            ValueError,
            "back end 'active-set', not of 'daqp'",
        ),
    ],
)
def test_nonsense_is_refused_in_a_sentence(toy_study, make, error, words):
    with pytest.raises(error, match=words):
        make(toy_study)
