"""The loop closed on noiseless linear plants: steady errors, delays, rates, drift."""

import numpy as np
import pytest

from socasadi.model import Modal
from socasadi.mpc import LinearMPC

T = 0.05
THETA = np.array([4.6, 0.08, 6e-3, -3e-3, -3e-3, 5.2, 0.15, 0.5e-3, 5e-3, -5e-3])
SYSTEM = Modal().state_space(THETA, T)
WITH_D = SYSTEM._replace(D=1e-3 * np.random.default_rng(3).normal(size=(2, 3)))
GAIN = SYSTEM.C @ np.linalg.solve(np.eye(4) - SYSTEM.A, SYSTEM.B)
WANTED = np.array([0.02, -0.01])


def with_gain(system, factor):
    return system._replace(B=factor * system.B, D=factor * system.D)


def closed_loop(mpc, system, plant, reference, steps, *, delay=0, push=(0.0, 0.0), force=(0.0, 0.0, 0.0), w=None):
    """Outputs and inputs of `plant`, whose tensions act `delay` samples late, under the controller made from `system`.

    `push` is added to the outputs, `force` to the tensions; `w(t)` is what is measured of the disturbances, the
    plant's last inputs.
    """
    controller = mpc.controller_for(system)
    x, y, outputs, inputs = np.zeros(len(plant.A)), np.array(push), [], []
    queue = [np.zeros(mpc.inputs)] * delay
    for t in range(steps):
        measured = () if w is None else (w(t),)
        u = controller.step(y, reference(t) if callable(reference) else reference, *measured)
        queue.append(u)
        acting = np.concatenate([queue.pop(0), *measured]) + force
        x = plant.A @ x + plant.B @ acting
        y = plant.C @ x + plant.D @ acting + push
        outputs.append(y)
        inputs.append(u)
    assert controller.info.fallbacks == 0
    return np.array(outputs), np.array(inputs)


SETTINGS = {
    "as preset": {},
    "no terminal cost": {"terminal": None},
    "blocks": {"control_horizon": (1, 1, 2, 6)},
    "two moves, no terminal cost": {"control_horizon": 2, "terminal": None},
    "delay": {"delay": 3},
    "delay, no terminal cost": {"delay": 2, "terminal": None, "horizon": 15},
    "rate bounds, short preview": {"rate_bounds": (-30, 30), "preview": 1, "rate_weight": 1.0, "slack_linear": 100.0},
}
WRONGS = {
    "nothing": (SYSTEM, SYSTEM, {}),
    "output": (SYSTEM, SYSTEM, {"push": (0.006, -0.004)}),
    "input": (SYSTEM, SYSTEM, {"force": (1.0, -0.5, 0.3)}),
    "gain of the model halved": (with_gain(SYSTEM, 0.5), SYSTEM, {}),
    "gain of the model doubled": (with_gain(SYSTEM, 2.0), SYSTEM, {}),
    "D": (WITH_D, WITH_D, {"push": (0.006, -0.004), "force": (1.0, -0.5, 0.3)}),
    "D unmodelled": (SYSTEM, WITH_D, {"push": (0.006, -0.004)}),
    "gain and D of the model doubled": (with_gain(WITH_D, 2.0), WITH_D, {"force": (1.0, -0.5, 0.3)}),
    "frequency and damping": (Modal().state_space(THETA * [1.3, 2, 1, 1, 1, 0.8, 1, 1, 1, 1], T), SYSTEM, {}),
}


@pytest.mark.parametrize("model", ["output", "input"])
@pytest.mark.parametrize("settings", SETTINGS)
@pytest.mark.parametrize("wrong", WRONGS)
def test_nothing_constant_leaves_a_steady_error(wrong, settings, model):
    """With so large a weight on changes that the loop settles for all of these errors."""
    mpc = LinearMPC(Modal(), R=100.0, disturbance_model=model, **SETTINGS[settings])
    system, plant, unknown = WRONGS[wrong]
    outputs, inputs = closed_loop(mpc, system, plant, WANTED, 2000, delay=mpc.delay, **unknown)
    assert np.abs(outputs[-20:] - WANTED).max() < 1e-6
    assert np.abs(inputs[-1]).max() < 10


@pytest.mark.parametrize("wrong", WRONGS)
def test_the_preset_leaves_no_steady_error_either(wrong):
    system, plant, unknown = WRONGS[wrong]
    outputs, _ = closed_loop(LinearMPC(Modal()), system, plant, WANTED, 1000, **unknown)
    assert np.abs(outputs[-20:] - WANTED).max() < 1e-6


@pytest.mark.parametrize("model", ["output", "input"])
def test_a_wrong_effect_of_a_measured_disturbance_leaves_no_steady_error(model):
    mpc = LinearMPC(Modal(), measured_disturbances=1, disturbance_model=model)
    plant = WITH_D._replace(B=WITH_D.B * [1, 1, 1.5], D=WITH_D.D * [1, 1, -2])
    outputs, _ = closed_loop(mpc, WITH_D, plant, WANTED, 1000, w=lambda t: np.array([2.0]))
    assert np.abs(outputs[-20:] - WANTED).max() < 1e-6


def test_a_disturbance_that_is_measured_is_met_before_it_shows():
    """Of a third cable that somebody else pulls. Unmeasured, it is found out only by what it does."""
    plant, others = SYSTEM, SYSTEM._replace(B=SYSTEM.B[:, :2], D=SYSTEM.D[:, :2])

    def pulled(t):
        return np.array([4.0 if t >= 50 else 0.0])

    fed, _ = closed_loop(LinearMPC(Modal(), measured_disturbances=1), plant, plant, WANTED, 150, w=pulled)
    blind = LinearMPC(Modal(inputs=2)).controller_for(others)
    x, y, outputs = np.zeros(4), np.zeros(2), []
    for t in range(150):
        x = plant.A @ x + plant.B @ np.r_[blind.step(y, WANTED), pulled(t)]
        y = plant.C @ x
        outputs.append(y)
    worst = [np.abs(run[50:] - WANTED).max() for run in (fed, np.array(outputs))]
    assert worst[0] < 0.25 * worst[1]


def circle(t, radius=0.03, period=5.0):
    angle = 2 * np.pi * (np.asarray(t)[..., None] * T / period)
    return radius * np.concatenate([np.cos(angle), np.sin(angle)], axis=-1)


def tracking_error(delay_of_model, delay_of_plant, steps=400):
    mpc = LinearMPC(Modal(), delay=delay_of_model, horizon=20)
    outputs, inputs = closed_loop(
        mpc, SYSTEM, SYSTEM, lambda t: circle(t + 1 + np.arange(20)), steps, delay=delay_of_plant
    )
    return np.sqrt(np.mean(np.sum((outputs - circle(np.arange(1, steps + 1)))[150:] ** 2, axis=1))), inputs


@pytest.mark.parametrize("delay", [1, 3])
def test_a_delay_that_the_model_has_costs_nothing_where_the_reference_is_known(delay):
    """The preview makes up for it; a controller that does not know of the delay is late, or unstable."""
    known, undelayed, unknown = tracking_error(delay, delay), tracking_error(0, 0), tracking_error(0, delay)
    assert known[0] < 1.5 * undelayed[0] + 1e-5
    assert unknown[0] > 5 * known[0]


def test_with_the_delay_in_the_model_the_inputs_are_those_without_delay_ahead_of_time():
    """Of an undisturbed robot whose bounds are far off and whose whole reference is seen: what is wanted later by the
    delay is met by the same tensions."""
    wide = {"input_bounds": (-100, 100), "output_bounds": None, "horizon": 12}
    late = circle(np.arange(1, 200) - 4)
    late[:20] = 0.0
    prompt, delayed = (
        closed_loop(
            LinearMPC(Modal(), delay=q, **wide),
            SYSTEM,
            SYSTEM,
            lambda t, q=q: np.vstack([late, late])[t : t + 12],
            100,
            delay=q,
        )[1]
        for q in (0, 3)
    )
    assert np.abs(prompt[40:90]).max() > 1
    assert np.abs(delayed[37:87] - prompt[40:90]).max() < 0.1 * np.abs(prompt[40:90]).max()


@pytest.mark.parametrize(
    "settings", [{}, {"control_horizon": (1, 3, 6)}, {"delay": 2}], ids=["all free", "blocks", "delay"]
)
@pytest.mark.parametrize("slowest", [-20.0, -80.0])
def test_rates_are_inside_their_bounds(settings, slowest):
    rng = np.random.default_rng(0)
    fastest = np.array([15.0, 30.0, np.inf])
    mpc = LinearMPC(Modal(), rate_bounds=(slowest, fastest), input_bounds=(-5, 5), **settings)
    controller, before, at_bound = mpc.controller_for(SYSTEM), np.zeros(3), 0
    for t in range(200):
        if t % 20 == 0:
            wanted = rng.uniform(-0.05, 0.05, 2)
        u = controller.step(0.01 * rng.normal(size=2), wanted)
        change = u - before
        assert (change >= slowest * T - 1e-12).all()
        assert (change <= fastest * T + 1e-12).all()
        assert np.abs(u).max() <= 5
        at_bound += (np.isclose(change, slowest * T) | np.isclose(change, fastest * T)).any()
        before = u
    assert at_bound > 30
    assert controller.info.fallbacks == 0


@pytest.mark.parametrize("factor", [0.9, 1.0, 1.1])
@pytest.mark.parametrize("terminal", ["riccati", None])
def test_what_the_outputs_do_not_see_of_the_tensions_returns_to_the_middle(factor, terminal):
    """A weight on changes alone leaves the common mode wherever the first large motion has pushed it: 3 N here, for
    good, and with a D that is 10 % off every further motion can push on."""
    plant = WITH_D._replace(D=factor * WITH_D.D)
    reference = np.repeat(np.random.default_rng(0).uniform(-0.02, 0.02, (500, 2)), 10, axis=0)
    _, inputs = closed_loop(LinearMPC(Modal(), terminal=terminal), WITH_D, plant, lambda t: reference[t + 1 :], 4900)
    common_mode = inputs @ np.linalg.svd(GAIN + WITH_D.D)[2][2]
    assert np.abs(common_mode).max() > 4
    assert np.abs(common_mode[-1500:].mean()) < 0.2


@pytest.mark.parametrize("bounds", [(-10, 10), (0, 10), ((-10, 0, -5), (10, 8, 10))])
def test_the_steady_tensions_are_the_ones_nearest_to_the_middle_of_their_bounds(bounds):
    """The weight that holds the common mode moves no steady state: the least-norm one, as it would be without."""
    mpc = LinearMPC(Modal(), input_bounds=bounds)
    middle = np.mean(mpc.input_limits, axis=0)
    share = mpc.input_scale
    wanted = np.array([0.01, -0.005])
    nearest = middle + share * (np.linalg.pinv(GAIN * share) @ (wanted - GAIN @ middle))
    assert (mpc.input_limits[0] < nearest).all()
    assert (nearest < mpc.input_limits[1]).all()
    outputs, inputs = closed_loop(mpc, SYSTEM, SYSTEM, wanted, 3000)
    assert np.allclose(inputs[-1], nearest, atol=1e-4)
    assert np.abs(outputs[-20:] - wanted).max() < 1e-6


@pytest.mark.parametrize("term", ["normalised", "literal"])
@pytest.mark.parametrize("model", ["output", "input"])
def test_at_rest_the_input_is_the_one_of_least_stage_cost(term, model):
    settings = {"input_term": term, "R": 3e-4 if term == "literal" else 1.0}
    reference = np.array([0.03, 0.01])
    weight = np.sqrt(settings["R"]) if term == "literal" else 1 / 10
    stacked = np.vstack([np.sqrt(1e3) * GAIN, weight * np.eye(3)])
    best = np.linalg.lstsq(stacked, np.r_[np.sqrt(1e3) * reference, np.zeros(3)], rcond=None)[0]
    mpc = LinearMPC(Modal(), disturbance_model=model, **settings)
    _, inputs = closed_loop(mpc, SYSTEM, SYSTEM, reference, 600)
    assert np.abs(best).max() > 1
    assert np.allclose(inputs[-1], best, rtol=1e-5, atol=1e-6)


def test_an_unstable_model_is_stabilised():
    """The second axis swings up by itself, 0.5 rad/s faster than it is damped."""
    unstable = Modal().state_space([*THETA[:6], -0.1, *THETA[7:]], T)
    assert np.abs(np.linalg.eigvals(unstable.A)).max() > 1.02
    outputs, _ = closed_loop(LinearMPC(Modal()), unstable, unstable, np.array([0.02, 0.02]), 600)
    assert np.abs(outputs[-20:] - 0.02).max() < 1e-6


def test_cables_that_only_pull_reach_the_reference():
    mpc = LinearMPC(Modal(), input_bounds=(0, 10))
    outputs, inputs = closed_loop(mpc, SYSTEM, SYSTEM, np.array([-0.02, 0.02]), 600)
    assert inputs.min() >= 0
    assert np.abs(outputs[-20:] - [-0.02, 0.02]).max() < 1e-6


def test_a_preview_tracks_better_than_a_held_reference_and_a_longer_one_better_than_a_short():
    wanted = circle(np.arange(1, 401), radius=0.05)
    errors = []
    for rows in (1, 3, 10):
        mpc = LinearMPC(Modal(), preview=rows)
        y = closed_loop(mpc, SYSTEM, SYSTEM, lambda t: circle(t + 1 + np.arange(10), radius=0.05), 400)[0]
        errors.append(np.sqrt(np.mean(np.sum((y - wanted)[100:] ** 2, axis=1))))
    assert errors[2] < 0.2 * errors[0]
    assert errors[2] < errors[1] < errors[0]
