"""Each method against what is known of it from elsewhere."""

from dataclasses import replace

import numpy as np
import pytest
from baselines_support import SYSTEM, THETA, LinearPlant, rod_study, study

from socasadi import SetPoints
from socasadi.baselines import (
    PID,
    DeePC,
    HInfinity,
    IterativeLearning,
    Koopman,
    Lab,
    Linearised,
    ModelSearch,
    NonlinearMPC,
    Softer,
    Subspace,
    WeightSearch,
    worth,
)
from socasadi.baselines.lab import Allocation, Foresight, believed, static_gain
from socasadi.baselines.methods import _deepc, _koopman, _nonlinear
from socasadi.baselines.methods._h_infinity import _in_tustins_variable, _most_robust
from socasadi.baselines.methods._sampled import sampled
from socasadi.campaign import probe
from socasadi.codegen import c_compiler
from socasadi.codegen import compiled as code
from socasadi.model import StateSpace, state_space_error, subspace

compiled = pytest.mark.skipif(c_compiler() is None, reason="its program is solved in C")


FEW = {
    "weights": pytest.param(WeightSearch(probing=12.0), 1.1, marks=pytest.mark.slow),
    "weights, fitted to flights": (WeightSearch(probing=12.0, flights=2), 1.1),
    "PID": (PID(probing=12.0), 4.0),
    "H-infinity": pytest.param(HInfinity(probing=8.0), 4.0, marks=pytest.mark.slow),
    "N4SID": (Subspace(probing=12.0), 1.1),
    "ILC": (IterativeLearning(WeightSearch(probing=20.0, most=3)), 1.1),
    "Koopman": pytest.param(Koopman(probing=12.0), 3.0, marks=compiled),
    "DeePC": pytest.param(DeePC(probing=12.0), 2.0, marks=compiled),
    "velocity DeePC": pytest.param(DeePC(velocity=True, probing=12.0), 3.0, marks=[compiled, pytest.mark.slow]),
}


@pytest.mark.parametrize(("method", "times"), FEW.values(), ids=FEW)
def test_a_hundred_seconds_with_the_arm_give_a_controller_that_follows_the_circle(method, times):
    """J within a factor of that of the MPC on the arm's own linearisation; not to move costs 300 times as much."""
    made = rod_study()
    (best,) = Linearised().offers(Lab(made, (100.0,)))
    pilot = method.controller(Lab(made, (100.0,)))
    flown, path = worth(made, pilot, 1)
    assert flown.J[0] < times * worth(made, best, 1)[0].J[0]
    assert flown.failed == flown.fallbacks == 0
    assert path.shape == (121, 2)


@pytest.mark.parametrize(
    ("bounds", "target"),
    [
        ((-10, 10), (0.02, -0.01)),
        ((0, 20), (0.03, 0.01)),  # what the pseudoinverse of the gains asks for would push
        ((-10, 10), (0.09, 0.0)),  # one cable at its bound, the others take its share
    ],
)
@pytest.mark.parametrize("method", [PID(10.0), HInfinity(10.0)])
def test_integral_action_leaves_no_steady_error_wherever_the_bounds_let_it_come(method, bounds, target):
    made = study(LinearPlant(), input_bounds=bounds)
    lab = Lab(made, (64.0,))
    pilot = method.controller(lab)
    pilot._allocation = Allocation(0.9 * pilot._allocation.gain)  # the robot's is another than it was
    plant, wanted = LinearPlant(), np.array([target])
    pilot.reset(0.0)
    y = plant.reset()
    for _ in range(2000):
        y = plant.step(pilot.step(y, wanted))
    np.testing.assert_allclose(y, wanted[0], atol=1e-4)  # an integrator of the loop shaping is one above 1e-3 rad/s


class Strong(LinearPlant):
    """Its outputs are a tenth larger than those of the one that was probed."""

    @property
    def true_output(self):
        return 1.1 * self.y

    def measured(self):
        return 1.1 * super().measured()


@compiled
@pytest.mark.parametrize(
    "make",
    [
        lambda mpc, record: _koopman._Controller(Koopman(), mpc, record, 5, 1e-5, 0.5, 1.0),
        lambda mpc, record: _deepc._Controller(mpc, True, record, 10, 1e-3, 1e5, 1.0),
    ],
    ids=["Koopman", "velocity DeePC"],
)
def test_a_prediction_that_errs_leaves_no_steady_error(make):
    record, plant, wanted = probe(LinearPlant(), (-10, 10), duration=20.0), Strong(), np.array([[0.03, 0.01]])
    pilot = make(study().mpc, record)
    pilot.reset(0.0)
    y = plant.reset()
    for _ in range(2000):
        y = plant.step(pilot.step(y, wanted))
    np.testing.assert_allclose(y, wanted[0], atol=1e-5)


def test_what_is_fed_forward_is_ahead_of_the_reference_and_lags_behind_that():
    """Along a ramp a filter of time constant T lags by T. Beyond the last row that is seen the reference stays."""
    time, slope = 0.05, np.array([0.02, -0.01])
    ramp = slope * time * np.arange(1, 4001)[:, None]
    made = Foresight(time, lead=4, smoothing=0.5)
    for k in range(2000):
        ahead = made.ahead(np.zeros(2), ramp[k : k + 10])
    np.testing.assert_allclose(ahead, ramp[1999 + 4] - slope * 0.5)
    made.begin()
    np.testing.assert_allclose(made.ahead(ramp[7], ramp[7:8]), ramp[7])


@pytest.mark.parametrize("method", [PID(10.0), HInfinity(10.0)])
def test_what_bounds_keep_out_of_reach_does_not_wind_up(method):
    """From a target at thrice the reach to one within takes little longer than from the end of the reach.

    What 20 s of an error of 0.2 m would have summed up takes a minute to undo.
    """
    made = study(LinearPlant())
    pilot, wanted = method.controller(Lab(made, (64.0,))), np.array([[0.03, 0.01]])
    settled = []
    for far in (0.09, 0.3):
        plant = LinearPlant()
        pilot.reset(0.0)
        y = plant.reset()
        for _ in range(400):
            y = plant.step(pilot.step(y, np.array([[far, 0.0]])))
        errors = []
        for _ in range(200):
            y = plant.step(pilot.step(y, wanted))
            errors.append(np.linalg.norm(y - wanted[0]))
        settled.append(max(np.flatnonzero(np.array(errors) > 1e-3), default=0))
    assert settled[1] < settled[0] + 60


def test_of_inputs_that_reach_what_is_wanted_the_smallest_within_bounds_are_taken():
    gain, rng = static_gain(SYSTEM), np.random.default_rng(0)
    allocation, at_bound = Allocation(gain), 0
    for _ in range(40):
        allowed = (rng.uniform(-10, -2, 3), rng.uniform(2, 10, 3))
        inside = rng.uniform(*allowed)
        u, missed = allocation.inputs(gain @ inside, allowed)
        at_bound += np.isclose(u, allowed).any()
        assert (u >= allowed[0]).all()
        assert (u <= allowed[1]).all()
        assert np.linalg.norm(u) <= np.linalg.norm(inside) * (1 + 1e-6)
        np.testing.assert_allclose(gain @ u, gain @ inside, atol=1e-4 * np.abs(gain @ inside).max())
        assert not missed.any()
    assert at_bound > 3
    uneven = np.diag([1.0, 0.02]) @ gain  # of a flat arm
    for _ in range(40):
        wanted = uneven @ rng.uniform(0, 10, 3)
        u, missed = Allocation(uneven).inputs(wanted, (np.zeros(3), np.full(3, 10.0)))
        assert not missed.any()
        np.testing.assert_allclose(uneven @ u, wanted, atol=1e-4 * np.abs(wanted).max())
    # Rates may leave an input no choice: those that rest out of their bounds.
    u, _ = allocation.inputs(gain @ [1.0, 2.0, 3.0], (np.array([1.0, 0, 0]), np.array([1.0, 9, 9])))
    np.testing.assert_allclose(gain @ u, gain @ [1.0, 2.0, 3.0], atol=1e-6)
    assert u[0] == 1.0
    assert allocation.inputs(gain @ inside, (np.ones(3), np.ones(3)))[0].tolist() == [1.0, 1.0, 1.0]
    u, missed = allocation.inputs(10 * gain @ inside, allowed)
    np.testing.assert_allclose(missed, 10 * gain @ inside - gain @ u, atol=1e-12)
    assert np.abs(missed).max() > 0.01


@pytest.mark.parametrize("frequency", [1.0, 5.0, 20.0, 40.0])
def test_loop_shaping_designs_for_the_response_that_the_law_meets(frequency):
    """From u_k to the y_k that is measured before it, as of the robot under a sinusoid."""
    time, inverse = 0.05, np.linalg.pinv(static_gain(SYSTEM))
    plain = subspace(probe(LinearPlant(), (-10, 10), duration=20.0), 4)  # SYSTEM without D
    plant, steps = LinearPlant(), 4000
    wave = np.exp(1j * frequency * time * np.arange(steps))
    measured = np.zeros((2, 2), dtype=complex)
    for i in range(2):
        for part, factor in ((wave.real, 1.0), (wave.imag, 1j)):
            y, seen = plant.reset(), []
            for value in part:
                seen.append(y)
                y = plant.step(inverse[:, i] * value)
            measured[:, i] += factor * np.array(seen)[-1]
    measured /= wave[-1]
    designed = _in_tustins_variable(plain, inverse, time)
    s = 2j / time * np.tan(frequency * time / 2)
    response = designed.C @ np.linalg.solve(s * np.eye(len(designed.A)) - designed.A, designed.B) + designed.D
    np.testing.assert_allclose(response, measured, atol=1e-3 * np.abs(measured).max())


def test_the_most_robust_controller_of_an_integrator_is_minus_one():
    """Of G = 1/s the largest robustness is 1/sqrt(2), reached by K = -1 (Glover and McFarlane 1989)."""
    one, zero = np.ones((1, 1)), np.zeros((1, 1))
    K = _most_robust(StateSpace(zero, one, one, zero))
    static = K.D - K.C @ np.linalg.solve(K.A, K.B)
    assert static == pytest.approx(-1.0, rel=0.25)  # gamma is 1.1 times the least
    margins = []
    for w in np.logspace(-3, 3, 400):
        G, k = 1 / (1j * w), (K.C @ np.linalg.inv(1j * w * np.eye(1) - K.A) @ K.B + K.D).item()
        S = 1 / (1 - G * k)
        margins.append(np.linalg.norm(np.array([[k * S, k * S * G], [S, S * G]]), 2))
    assert max(margins) <= 1.1 * np.sqrt(2) * (1 + 1e-6)


@compiled
@pytest.mark.parametrize("effort", [1.0, 4.0])
def test_without_noise_and_regularisation_deepc_is_the_mpc_on_the_true_model(effort):
    """The equivalence of Coulson, Lygeros, Dörfler 2019: the plan of the data is that of the model."""
    made = study(output_bounds=None, horizon=8)
    record = probe(LinearPlant(), (-10, 10), duration=20.0)
    deepc = _deepc._Controller(made.mpc, False, record, 6, 1e-9, 1e9, effort)
    plant, rng = LinearPlant(), np.random.default_rng(0)
    y = plant.reset()
    deepc.reset(0.0)
    wanted = np.tile([0.01, 0.005], (8, 1))
    for _ in range(8):
        deepc.step(y, wanted)
        deepc.held = rng.uniform(-5, 5, 3)
        y = plant.step(deepc.held)
    u = deepc.step(y, wanted)
    # The same by least squares on the true model: sum Q |y - r|^2 + effort |change of u / 10|^2, no bound active.
    rows, free, x = [], [], plant.x
    response = [SYSTEM.C @ np.linalg.matrix_power(SYSTEM.A, k) for k in range(9)]
    for k in range(8):
        row = np.hstack([response[k - j] @ SYSTEM.B * 10 if j <= k else np.zeros((2, 3)) for j in range(8)])
        rows.append(np.sqrt(1e3) * row)
        free.append(np.sqrt(1e3) * (wanted[k] - response[k + 1] @ x))
    change = np.sqrt(effort) * (np.eye(24) - np.eye(24, k=-3))
    before = np.sqrt(effort) * np.concatenate([plant.tension / 10, np.zeros(21)])
    plan = np.linalg.lstsq(np.vstack([*rows, change]), np.concatenate([*free, before]), rcond=None)[0]
    np.testing.assert_allclose(u, np.clip(10 * plan[:3], -10, 10), atol=1e-3)


@compiled
def test_a_lifting_without_monomials_predicts_a_linear_robot_exactly():
    pilot = _koopman._Controller(Koopman(degree=1), study().mpc, probe(LinearPlant(), (-10, 10)), 2, 1e-12, 1.0, 1.0)
    assert pilot.prediction_error(probe(LinearPlant(), (-10, 10), seed=1)) < 1e-6


def test_n4sid_finds_the_response_of_the_robot():
    found = subspace(probe(LinearPlant(), (-10, 10), duration=20.0), 4)
    for k in range(30):
        theirs, true = (m.C @ np.linalg.matrix_power(m.A, k) @ m.B + (m.D if k == 0 else 0) for m in (found, SYSTEM))
        np.testing.assert_allclose(theirs, true, atol=1e-6)


class Soft(LinearPlant):
    """Its output is a tenth more than linear at 30 mm, and linear near rest."""

    def measured(self):
        self.y = self.y * (1 + 0.1 * np.sum(self.y**2) / 0.03**2)
        return super().measured()


def test_a_model_fitted_to_flights_knows_the_motion_of_the_task_better():
    """On a circle of 30 mm the arm is a tenth softer than near rest, where small steps of probing see it."""
    made = study(Soft(noise=1e-4), input_bounds=(-6, 6), duration=12.0)
    flight, errors = Lab(made, (12.0,)).fly(made.mpc.controller(THETA)).record, []
    for flights in (0, 3):
        lab, offered = Lab(made, (100.0,)), []
        offered.extend((lab.spent, pilot) for pilot in WeightSearch(probing=20.0, flights=flights, most=1).offers(lab))
        (first, _), (_, pilot) = offered[0], offered[-1]
        assert first == 20.0  # the untuned controller is there as soon as the record is
        assert lab.flights == flights + 1
        errors.append(state_space_error(believed(pilot), flight))
    assert errors[1] < 0.5 * errors[0]


def test_only_a_probed_model_is_fitted_to_flights():
    with pytest.raises(ValueError, match="flights=3: the linearised rod takes 0"):
        WeightSearch("linearised", flights=3)
    with pytest.raises(ValueError, match="flights is a whole number of at least 0, not -1"):
        WeightSearch(flights=-1)


@pytest.mark.parametrize(
    ("make", "fault"),
    [
        (lambda: WeightSearch("family"), "unknown model 'family'; there are subspace, linearised"),
        (lambda: WeightSearch(by="median"), "unknown by 'median'; there are mean, worst"),
        (lambda: ModelSearch("Sobol"), "unknown kind 'Sobol'; there are bayesian, sobol, random"),
        (lambda: NonlinearMPC("pcc"), "unknown model 'pcc'; there are rod, constant curvature"),
        (lambda: NonlinearMPC(trials=0), "trials is a whole number of at least 1, not 0"),
        (lambda: IterativeLearning(caution=-1.0), r"caution is a number of at least 0, not -1\.0"),
        (lambda: DeePC(probing=-3.0), r"probing is a number of at least 1, not -3\.0"),
        (lambda: PID(probing="long"), "probing is a number of at least 1, not 'long'"),
        (lambda: Subspace(float("inf")), "probing is a number of at least 1, not inf"),
        (lambda: Koopman(degree=2.5), r"degree is a whole number of at least 1, not 2\.5"),
        (lambda: Koopman(delays=1), "delays is a whole number of at least 2, not 1"),
        (lambda: next(Koopman(probing=2.0).offers(Lab(study(), (60.0,)))), "2 s has 40 samples; 82 are needed"),
        (lambda: next(DeePC(probing=5.0).offers(Lab(study(), (60.0,)))), "5 s has 100 samples; 136 are needed"),
    ],
)
def test_a_setting_that_makes_no_sense_is_refused(make, fault):
    with pytest.raises(ValueError, match=fault):
        make()
    with pytest.raises(TypeError, match="over is a tuple"):
        WeightSearch(over=Softer(0.8))


def test_the_difference_quotients_are_the_derivatives_of_the_rods_step():
    made = rod_study()
    plant = made.plant
    n = 2 * plant.rod.dof
    rng = np.random.default_rng(0)
    x, u = np.concatenate([0.3 * rng.standard_normal(n // 2), rng.standard_normal(n // 2)]), rng.uniform(-5, 5, 3)
    x[n // 4 :] *= 0.05
    after, slopes, y, C = (value.full() for value in sampled(plant, 3)(x, u))
    step = plant.rod.step_expression(plant.sample_time, plant.sample_time)
    exact = step.jacobian()(x, u, np.zeros(3), after)
    exact = np.hstack([exact[0].full(), exact[1].full()])
    np.testing.assert_allclose(slopes, exact, atol=2e-4 * np.abs(exact).max())
    np.testing.assert_allclose(y, plant.sensor(after).full())
    assert C.shape == (2, n)


@compiled
def test_near_rest_the_nonlinear_mpc_does_what_the_one_on_the_linearisation_does():
    made = rod_study()
    small = Lab(study(made.plant, preview=10), (6.0,))
    nonlinear, linear = (next(method.offers(small)) for method in (NonlinearMPC(doubt=1.0), Linearised()))
    assert (nonlinear.mpc.R, nonlinear.mpc.input_noise) == (linear.mpc.R, linear.mpc.input_noise)
    task = SetPoints(points=((0.004, -0.002),), duration=4.0)
    flown = [worth(replace(made, task=task), pilot, 1)[0] for pilot in (nonlinear, linear)]
    assert flown[0].J[0] == pytest.approx(flown[1].J[0], rel=0.1)
    assert flown[0].settled < 1.5e-3


@compiled
def test_with_finer_steps_of_integration_the_nonlinear_mpc_flies_no_better():
    made, costs = rod_study(Q=1e3, R=1.0), []
    mpc, plant = replace(made.mpc, tuned=("input_noise",)).at([*THETA, 1e-3]), made.plant
    for steps in (1, 5):
        pilot = _nonlinear._Controller(mpc, plant, code(sampled(plant, 3, steps)))
        costs.append(worth(made, pilot, 1)[0].J[0])
    assert costs[0] == pytest.approx(costs[1], rel=1e-3)


def test_what_needs_a_rod_says_so():
    for method in (NonlinearMPC(), Linearised()):
        assert method.information == "plant model"
        with pytest.raises(TypeError, match="simulated rod"):
            next(method.offers(Lab(study(), (60.0,))))
