"""The controller in C: what is applied when an answer is missing, faults, numbers that are none."""

from dataclasses import replace

import numpy as np
import pytest

from socasadi import LinearMPC, Modal
from socasadi.codegen import c_compiler
from socasadi.mpc import (
    KKT_TOLERANCE,
    ActiveSet,
    control_law,
    rest_state,
)

pytestmark = pytest.mark.skipif(c_compiler() is None, reason="no C compiler")
THETA = np.array([4.6, 0.08, 6e-3, -3e-3, -3e-3, 5.2, 0.15, 0.5e-3, 5e-3, -5e-3])
SYSTEM = Modal().state_space(THETA, 0.05)
TIGHT = LinearMPC(Modal(), input_bounds=(-4, 4), output_bounds=(-0.03, 0.03))


def random_sample(rng, mpc):
    """Tensions before, a measurement and a reference that ask for more than the bounds give, often enough."""
    held, y = rng.uniform(*mpc.input_limits), rng.uniform(-0.06, 0.06, 2)
    return held, y, rng.uniform(-0.08, 0.08, 2) + rng.uniform(-0.02, 0.02, (mpc.reference_rows, 2))


@pytest.mark.parametrize("price", [0.0, 100.0])
def test_along_the_programs_of_a_controller_the_start_changes_nothing_either(price):
    mpc = replace(TIGHT, slack_linear=price, rate_bounds=(-60, 60))
    design = mpc.design(SYSTEM)
    assert np.allclose(np.diag(design.dual.gram) + design.dual.softness, 1, rtol=0, atol=1e-12)
    rng, warm, cold = np.random.default_rng(6), ActiveSet(design.dual), ActiveSet(design.dual)
    parameters, active, spared = np.r_[np.zeros(design.dual.map.shape[1] - 1), 1.0], 0, 0
    for t in range(300):
        # Jumps, and a walk between them.
        change = 0.05 * rng.normal(size=len(parameters) - 1)
        parameters[:-1] = change if t % 10 == 0 else parameters[:-1] + 0.05 * change
        cold.forget()
        one, other = warm.solve(parameters), cold.solve(parameters)
        assert max(one.residual, other.residual) < 1e-9
        assert np.abs(one.values - other.values).max() < 1e-9
        active += np.count_nonzero(one.multipliers)
        spared += other.iterations - one.iterations
    assert active > 300
    assert spared > 100


@pytest.mark.parametrize("mpc", [TIGHT, replace(TIGHT, rate_bounds=(-60, 50))], ids=["no rates", "rates"])
@pytest.mark.parametrize("cap", [1, 2])
def test_a_cap_that_is_met_yields_the_clipped_law_and_no_wrong_answer(cap, mpc):
    free, capped = mpc.controller_for(SYSTEM), mpc.controller_for(SYSTEM)
    capped._data.qp.iterations = cap  # pyright: ignore[reportAttributeAccessIssue]
    law, rng = control_law(mpc, free.design, with_qp=False), np.random.default_rng(7)
    met = 0
    for _ in range(200):
        size = 10 ** rng.uniform(-1, 0.3)
        held, y, reference = (size * part for part in random_sample(rng, mpc))
        for controller in (free, capped):
            controller.reset(held)
        right, u = free.step(y, reference), capped.step(y, reference)
        if free.info.iterations <= cap:
            assert (capped.info.status, capped.info.iterations) == (0, free.info.iterations)
            assert np.array_equal(u, right)
        else:
            met += 1
            clipped = law(y, reference.ravel(), (), rest_state(mpc, free.design, held))[0].full().ravel()
            assert capped.info.status == 1
            assert capped.info.iterations == cap
            assert (capped.info.clipped, capped.info.held, capped.info.worst_residual) == (1, 0, 0.0)
            assert capped.info.residual > KKT_TOLERANCE
            assert np.allclose(u, clipped, rtol=0, atol=1e-12)
    assert 20 < met < 180


@pytest.mark.parametrize("real", ["double", "float"])
def test_an_answer_is_believed_up_to_the_residual_that_its_numbers_allow(real):
    """Left as it is by a cap of 0, the unconstrained answer is off by as much as the bounds are exceeded by."""
    controller, believed, not_believed = TIGHT.controller_for(SYSTEM, real=real), [], []
    controller._data.qp.iterations = 0  # pyright: ignore[reportAttributeAccessIssue]

    def residual(size):
        controller.reset()
        controller.step([0.0, 0.0], np.array([size, size / 2]))
        return controller.info.residual

    inside, outside = 0.0, 1.0
    while outside - inside > 1e-6 * outside:
        size = (inside + outside) / 2
        inside, outside = (size, outside) if residual(size) == 0 else (inside, size)
    for excess in 10 ** np.linspace(-7, 0, 200):
        off = residual(outside * (1 + excess))
        (not_believed if controller.info.status else believed).append(off)
    limit = controller._data.tolerance  # pyright: ignore[reportAttributeAccessIssue]
    assert limit == KKT_TOLERANCE if real == "double" else 1e-4 < limit < 0.02
    assert 0.8 * limit < max(believed) <= limit < min(not_believed) < 1.25 * limit


def test_what_is_applied_in_place_of_an_answer_is_what_the_observer_counts_with():
    """With a cap of 0 the C is the clipped law, sample after sample."""
    controller = TIGHT.controller_for(SYSTEM)
    controller._data.qp.iterations = 0  # pyright: ignore[reportAttributeAccessIssue]
    law, state = control_law(TIGHT, controller.design, with_qp=False), rest_state(TIGHT, controller.design, np.zeros(3))
    rng = np.random.default_rng(19)
    for _ in range(60):
        _, y, reference = random_sample(rng, TIGHT)
        u, after, *_ = law(y, reference.ravel(), (), state)
        state = after.full().ravel()
        assert np.allclose(controller.step(y, reference), u.full().ravel(), rtol=0, atol=1e-9)
        assert np.allclose(np.concatenate(controller.estimate), state[:6], rtol=0, atol=1e-11)
    assert controller.info.clipped > 30


def test_after_a_reference_that_overflows_the_next_input_is_right():
    both = [replace(TIGHT, backend=name).controller_for(SYSTEM) for name in ("active-set", "daqp")]
    rng, spoilt, worst = np.random.default_rng(8), 0, 0
    for t in range(60):
        _, y, reference = random_sample(rng, TIGHT)
        if t % 3 == 1:
            reference[:] = rng.choice([-1, 1], 2) * 1e308
        one, other = (controller.step(0.3 * y, reference) for controller in both)
        assert np.allclose(one, other, rtol=0, atol=1e-6)
        spoilt += both[0].info.status == 2
        assert both[0].info.status in ((0,), (1, 2))[t % 3 == 1]
        assert both[0].info.steps == t + 1
        worst = max(worst, both[0].info.iterations)
        assert both[0].info.worst_iterations == worst
    assert spoilt == both[0].info.held > 5
    assert both[0].info.worst_residual < KKT_TOLERANCE


def test_controllers_side_by_side_do_not_disturb_each_other():
    specifications = [TIGHT, replace(TIGHT, slack_linear=100.0, delay=2, rate_bounds=(-60, 60)), TIGHT]

    def samples(k):
        rng = np.random.default_rng(k)
        return [random_sample(rng, specifications[k])[1:] for _ in range(40)]

    together = [mpc.controller_for(SYSTEM) for mpc in specifications]
    inputs = [[] for _ in specifications]
    for each in zip(*map(samples, range(3)), strict=True):
        for controller, sample, answers in zip(together, each, inputs, strict=True):
            answers.append(controller.step(*sample))
    for k, mpc in enumerate(specifications):
        alone = mpc.controller_for(SYSTEM)
        assert np.array_equal([alone.step(*sample) for sample in samples(k)], inputs[k])
        assert alone.info == together[k].info


@pytest.mark.parametrize(
    "settings", [{}, {"rate_bounds": (-60, 60)}, {"slack_linear": 100.0}, {"input_bounds": (0, 10)}]
)
def test_single_precision_follows_double_within_a_ten_thousandth_of_the_bound(settings):
    """On a hundred ordinary problems, one after the other and each from rest."""
    mpc = replace(LinearMPC(Modal(), output_bounds=(-0.05, 0.05)), **settings)
    pair = [mpc.controller_for(SYSTEM, real=real) for real in ("double", "float")]
    rng, at_bound = np.random.default_rng(9), 0
    for t in range(100):
        held, y, reference = random_sample(rng, mpc)
        if t % 2:
            for controller in pair:
                controller.reset(held)
        exact, rounded = (controller.step(y, reference) for controller in pair)
        assert np.abs(rounded - exact).max() < 1e-4 * mpc.input_scale.min()
        assert pair[1].info.status == 0
        at_bound += np.isclose(exact, mpc.input_limits, rtol=0, atol=1e-9).any()
    assert at_bound > 20


TOLD = replace(TIGHT, measured_disturbances=1, rate_bounds=(-60, 60), slack_linear=30.0)


WITH_D = SYSTEM._replace(D=1e-3 * np.random.default_rng(3).normal(size=(2, 3)))


def in_c(controller, y, reference, w=()):
    """One step of the C, past what Python refuses."""
    return controller._advance(*(np.array(part, dtype=float) for part in (y, reference, w)))


def test_numbers_that_are_none_are_met_in_c_as_the_law_says():
    """In measurements, references and measured disturbances, in any order, along one run."""
    controller, rng = TOLD.controller_for(WITH_D), np.random.default_rng(12)
    law, state = control_law(TOLD, controller.design), rest_state(TOLD, controller.design, np.zeros(2))
    met, no_measurements = np.zeros(3, int), 0
    for _ in range(300):
        parts = 0.03 * rng.normal(size=2), 0.05 * rng.normal(size=(10, 2)), rng.normal(size=1)
        for part in parts:
            if rng.random() < 0.15:
                part.flat[rng.integers(part.size)] = rng.choice([np.nan, np.inf, -np.inf])
        u = in_c(controller, *parts)
        expected, state, status, _, refused = law(parts[0], parts[1].ravel(), parts[2], state)
        state, no_measurements = state.full().ravel(), no_measurements + int(refused)
        assert np.allclose(u, expected.full().ravel(), rtol=0, atol=1e-7)
        assert (controller.info.status, controller.info.refused) == (int(status), no_measurements)
        met[int(status)] += 1
    assert met[[0, 2]].min() > 20
    assert no_measurements > 20
    assert (controller.info.clipped, controller.info.held) == (met[1], met[2])


@pytest.mark.parametrize("real", ["double", "float"])
@pytest.mark.parametrize("hole", [np.nan, np.inf, -np.inf])
def test_an_input_before_that_is_no_number_counts_as_none(hole, real):
    one, other = (TIGHT.controller_for(SYSTEM, real=real) for _ in range(2))
    one._rest(np.array([hole, 2.0, hole]))
    other.reset([0.0, 2.0, 0.0])
    for _ in range(3):
        assert np.array_equal(one.step([0.01, 0.0], [0.02, 0.01]), other.step([0.01, 0.0], [0.02, 0.01]))


@pytest.mark.parametrize("mpc", [TIGHT, TOLD], ids=["plain", "told"])
@pytest.mark.parametrize("fault", [np.nan, np.inf, -np.inf, 1e12])
def test_an_observer_that_a_fault_has_spoilt_starts_anew_from_rest_under_the_input_before(fault, mpc):
    """And has the very next measurement already."""
    spoilt, rested = mpc.controller_for(WITH_D), mpc.controller_for(WITH_D)
    w = [np.array([0.3])] * mpc.measured_disturbances
    held = spoilt.step([0.01, -0.01], [0.02, 0.01], *w)
    for i in range(len(spoilt.design.A)):
        spoilt.reset(held)
        rested.reset(held)
        spoilt._reals[i] = fault
        # What a robot at rest shows after a sample at rest, it is at rest.
        for _ in range(3):
            y, wanted = [0.012, -0.008], [0.02, 0.01]
            u, right = spoilt.step(y, wanted, *w), rested.step(y, wanted, *w)
            assert np.allclose(u, right, rtol=0, atol=1e-6)
        assert spoilt.info.fallbacks == spoilt.info.refused == 0


def test_a_measurement_is_plausible_up_to_its_limit_alone():
    controller = TIGHT.controller_for(SYSTEM)
    limit = controller.design.plausible
    for sign in (1, -1):
        for at in range(2):
            y = np.zeros(2)
            for size, refused in ((limit, 1), (np.nextafter(limit, 0), 0), (np.nextafter(limit, np.inf), 1)):
                y[at] = sign * size
                controller.reset()
                controller.step(y, [0.0, 0.0])
                assert controller.info.refused == refused


@pytest.mark.parametrize("real", ["double", "float"])
def test_inputs_at_their_bounds_are_not_out_of_them_by_a_rounding_whatever_the_bounds(real):
    rng, number = np.random.default_rng(18), np.float64 if real == "double" else np.float32
    at_bound = 0
    for _ in range(25):
        lower, upper = np.sort(rng.uniform(-9, 9, (2, 3)), axis=0)
        controller = LinearMPC(Modal(), input_bounds=(lower, upper)).controller_for(SYSTEM, real=real)
        for wanted in ([9.0, 9.0], [-9.0, 9.0], [-9.0, -9.0], [9.0, -9.0]):
            u = controller.step([0.0, 0.0], wanted).astype(number)
            assert (lower.astype(number) <= u).all()
            assert (u <= upper.astype(number)).all()
            at_bound += np.count_nonzero((u == lower.astype(number)) | (u == upper.astype(number)))
    assert at_bound > 100
