"""What the analysis says of a loop, against the controller itself in simulation, scipy, and values by hand."""

import numpy as np
import pytest
from scipy.linalg import block_diag, solve_discrete_are
from scipy.signal import cont2discrete

from socasadi.model import Modal, StateSpace
from socasadi.mpc import LinearMPC
from socasadi.mpc.analysis._analysis import analyse
from socasadi.mpc.analysis._loop import closed_loop
from socasadi.mpc.analysis._observability import observability, unstable_part
from socasadi.mpc.analysis._peak import largest_gain

T = 0.05
THETA = np.array([4.6, 0.08, 6e-3, -3e-3, -3e-3, 5.2, 0.15, 0.5e-3, 5e-3, -5e-3])
SYSTEM = Modal().state_space(THETA, T)
OTHER = Modal().state_space(THETA * [1.1, 0.8, 1.1, 1.2, 0.9, 0.9, 1.2, 1.5, 0.9, 1.1], T)
OTHER = OTHER._replace(D=1e-4 * np.random.default_rng(5).normal(size=(2, 3)))


def oscillator(stiffness, damping, gain, sample_time=T, method="zoh"):
    """y'' + damping y' + stiffness y = gain u, sampled."""
    continuous = (
        np.array([[0, 1], [-stiffness, -damping]]),
        np.array([[0], [gain]]),
        np.array([[1, 0]]),
        np.zeros((1, 1)),
    )
    return StateSpace(*cont2discrete(continuous, sample_time, method)[:4])


SINGLE = oscillator(21.0, 0.7, 0.12)
UNSTABLE = oscillator(-4.0, 0.7, 1.2)
WIDE = {"input_bounds": (-100, 100), "output_bounds": None, "R": 100.0}
SETTINGS = {
    "default": {},
    "blocks, input disturbance, no terminal cost": {
        "control_horizon": (1, 2, 7),
        "disturbance_model": "input",
        "terminal": None,
        "rate_weight": 0.3,
    },
    "delay": {"delay": 2, "control_horizon": 4},
    "measured disturbance": {"measured_disturbances": 1, "preview": 3},
    "input weight": {"input_term": "normalised"},
    "feedthrough": {"system": SYSTEM._replace(D=2e-4 * np.random.default_rng(2).normal(size=(2, 3))), "horizon": 5},
    "feedthrough and delay": {"system": SYSTEM._replace(D=np.full((2, 3), 2e-4)), "delay": 1},
}


def controller(system=SYSTEM, **settings):
    p, m = system.D.shape
    return LinearMPC(Modal(axes=p, inputs=m), **{**WIDE, **settings}).controller_for(system)


def analysis(of, plant=None):
    return analyse(of.mpc, of.design, plant)


def fly(of, plant, samples, *, reference=0.0, x=0.0, on_y=0.0, on_u=0.0, noise=None, w=0.0, held=0.0):
    """The controller against a linear plant, sample by sample: true outputs and inputs, u_max."""
    m, p, delay = of.mpc.inputs, of.mpc.outputs, of.mpc.delay
    of.reset(held)
    x = np.zeros(len(plant.A)) + x
    acting, measured = [np.zeros(m) + held] * (delay + 1), np.zeros(of.mpc.measured_disturbances) + w
    y, v = np.empty((samples, p)), np.empty((samples, m))
    for t in range(samples):
        y[t] = plant.C @ x + plant.D @ np.r_[acting[delay] + on_u, measured] + on_y
        n = 0.0 if noise is None else noise[t]
        u = of.step(y[t] + n, np.zeros(p) + reference, measured if len(measured) else None)
        v[t] = u / of.mpc.input_scale
        acting = [u, *acting]
        x = plant.A @ x + plant.B @ np.r_[acting[delay] + on_u, measured]
    assert of.info.fallbacks == 0
    return y, v


@pytest.mark.parametrize("setting", SETTINGS)
def test_the_linear_loop_is_the_controller_sample_for_sample(setting):
    of, rng = controller(**SETTINGS[setting]), np.random.default_rng(1)
    k = of.mpc.measured_disturbances
    reference, on_y, on_u, noise = [0.02, -0.01], [3e-3, -2e-3], rng.normal(size=3 - k), 1e-3 * rng.normal(size=(80, 2))
    y, v = fly(of, OTHER, 80, reference=reference, on_y=on_y, on_u=on_u, noise=noise)
    loop = closed_loop(of.mpc, of.design, OTHER)
    X = np.zeros(len(loop.A))
    for t in range(80):
        e = np.r_[reference, on_y, on_u / 100, np.zeros(k), noise[t]]
        np.testing.assert_allclose(loop.C @ X + loop.D @ e, np.r_[y[t], v[t]], atol=1e-12)
        X = loop.A @ X + loop.B @ e


@pytest.mark.parametrize("plant", [None, OTHER], ids=["model", "other plant"])
@pytest.mark.parametrize("setting", SETTINGS)
def test_the_poles_are_those_that_the_flown_response_consists_of(setting, plant):
    of = controller(**SETTINGS[setting])
    told = analysis(of, plant)
    _, v = fly(
        of,
        plant or SETTINGS[setting].get("system", SYSTEM),
        2 * len(told.poles) + 10,
        x=1e-2 * np.arange(1, 5),
        held=7.0,
    )

    def left_by(poles):
        """What a recurrence with these poles for its characteristic polynomial leaves of the inputs."""
        windows = np.lib.stride_tricks.sliding_window_view(v, len(poles) + 1, axis=0)
        return np.abs(windows @ np.poly(poles).real[::-1]).max() / np.abs(v).max()

    left = left_by(told.poles)
    assert left < 1e-10
    assert left_by(told.poles[np.abs(told.poles) < 0.9999 * told.spectral_radius]) > 1e3 * left


@pytest.mark.parametrize("setting", SETTINGS)
def test_regulator_and_observer_poles_are_those_of_the_loop_on_the_model(setting):
    of = controller(**SETTINGS[setting])
    apart, together = analysis(of), analysis(of, SETTINGS[setting].get("system", SYSTEM))
    assert len(apart.poles) == len(together.poles)
    assert apart.stable
    # Poles of inputs on their way are a Jordan block at 0, which rounding spreads.
    for pole in together.poles[np.abs(together.poles) > 1e-3]:
        assert np.abs(apart.poles - pole).min() < 1e-6


def test_a_first_order_loop_by_hand():
    """Over one sample, q (y - r)^2 + R (v - v_before)^2: z^2 - rho (1 + a) z + a rho = 0, rho = R / (q b^2 + R)."""
    a, b, q, R = 0.8, 0.3, 5.0, 2.0
    system = StateSpace(*(np.array([[value]]) for value in (a, b, 1.0, 0.0)))
    of = controller(system, horizon=1, terminal=None, Q=q, R=R, input_bounds=(-1, 1), measurement_noise=0.3)
    rho = R / (q * b**2 + R)
    told = analysis(of)
    np.testing.assert_allclose(np.sort_complex(told.regulator.values), np.roots([1, -rho * (1 + a), a * rho])[::-1])
    pole = np.log(told.regulator.values[0].astype(complex)) / T
    ratio, frequency = told.regulator.least_damped
    assert ratio == pytest.approx(-pole.real / abs(pole))
    assert frequency == pytest.approx(abs(pole) / (2 * np.pi))
    assert told.regulator.time_constant == pytest.approx(-1 / pole.real)


@pytest.mark.parametrize("horizon", [1, 10])
def test_with_a_terminal_cost_the_regulator_is_scipys_infinite_horizon_one(horizon):
    system = SYSTEM._replace(D=1e-3 * np.random.default_rng(3).normal(size=(2, 3)))
    of = controller(system, horizon=horizon, input_term="normalised", R=1.0)
    A, B, C, D = system.A, 100 * system.B, system.C, 100 * system.D
    # The cost is on the next output, C (A x + B v) + D v.
    out, through = C @ A, C @ B + D
    Q, R, S = 1e3 * out.T @ out, 1e3 * through.T @ through + np.eye(3), 1e3 * out.T @ through
    P = solve_discrete_are(A, B, Q, R, s=S)
    poles = np.linalg.eigvals(A - B @ np.linalg.solve(R + B.T @ P @ B, B.T @ P @ A + S.T))
    told = analysis(of).regulator.values
    np.testing.assert_allclose(np.sort_complex(told[:4]), np.sort_complex(poles), atol=1e-8)
    assert np.abs(told[4:]).max() < 1e-8


@pytest.mark.parametrize("damping", [0.5, 0.05, 1e-4])
def test_the_norm_of_a_resonance_is_the_textbooks(damping):
    """1 / (2 zeta sqrt(1 - zeta^2)) at omega_n sqrt(1 - 2 zeta^2), which the bilinear map with T = 2 keeps."""
    natural = 0.3
    system = oscillator(natural**2, 2 * damping * natural, natural**2, 2.0, "bilinear")
    gain, angle = largest_gain(*system)
    assert gain == pytest.approx(1 / (2 * damping * np.sqrt(1 - damping**2)), rel=1e-8)
    assert np.tan(angle / 2) == pytest.approx(natural * np.sqrt(1 - 2 * damping**2), rel=1e-4)


@pytest.mark.parametrize("seed", range(5))
def test_the_norm_of_many_channels_is_the_largest_on_a_fine_grid(seed):
    rng = np.random.default_rng(seed)
    turns = [
        r * np.array([[np.cos(t), -np.sin(t)], [np.sin(t), np.cos(t)]]) for r, t in rng.uniform(0.9, 0.999, (4, 2))
    ]
    A, B, C, D = block_diag(*turns), rng.normal(size=(8, 2)), rng.normal(size=(3, 8)), rng.normal(size=(3, 2))
    gain, angle = largest_gain(A, B, C, D)

    def response(angles):
        resolvent = np.exp(1j * angles)[:, None, None] * np.eye(8) - A
        return np.linalg.norm(C @ np.linalg.solve(resolvent, B + 0j) + D, 2, axis=(1, 2))

    on_grid = response(np.linspace(0, np.pi, 20001)).max()
    assert on_grid * (1 - 1e-12) <= gain <= on_grid * (1 + 1e-3)
    assert response(np.array([angle]))[0] == pytest.approx(gain, rel=1e-9)


def test_a_tone_of_noise_at_the_worst_frequency_is_amplified_by_the_worst_case_gains():
    of = controller(SINGLE)
    told = analysis(of)
    t = np.arange(4000)
    for peak, amplified in (
        (told.complementary, lambda y, v, noise: y),
        (told.sensitivity, lambda y, v, noise: y + noise),
        (told.noise_to_input, lambda y, v, noise: v),
    ):
        tone = 1e-3 * np.exp(2j * np.pi * peak.frequency * T * t[:, None])
        cosine, sine = (amplified(*fly(of, SINGLE, len(t), noise=part), part) for part in (tone.real, tone.imag))
        assert np.hypot(cosine, sine)[-1] == pytest.approx(1e-3 * peak.gain, rel=1e-6)


def perturbed(system, gain, pole, sign):
    """The single-output system with an error of its output: sign gain (1 - pole z) / (z - pole), all-pass."""
    A, B, C, D = system
    a, d = sign * gain * (1 - pole**2), -sign * gain * pole
    return StateSpace(
        np.block([[A, np.zeros((len(A), 1))], [C, np.array([[pole]])]]),
        np.vstack([B, D]),
        np.hstack([(1 + d) * C, np.array([[a]])]),
        (1 + d) * D,
    )


def test_the_small_gain_bound_holds_and_is_sharp():
    of = controller(SINGLE)
    bound = analysis(of).robust_error
    errors = [(pole, sign) for pole in np.linspace(-0.99, 0.99, 199) for sign in (-1, 1)]
    assert all(analysis(of, perturbed(SINGLE, 0.999 * bound, *error)).stable for error in errors[::4])
    assert not all(analysis(of, perturbed(SINGLE, 1.02 * bound, *error)).stable for error in errors)


def test_errors_between_outputs_within_the_small_gain_bound_leave_the_loop_stable():
    of, rng = controller(), np.random.default_rng(0)
    bound = analysis(of).robust_error
    for _ in range(30):
        error = np.linalg.qr(rng.normal(size=(2, 2)))[0] * 0.999 * bound
        mixed = np.eye(2) + error
        assert analysis(of, SYSTEM._replace(C=mixed @ SYSTEM.C, D=mixed @ SYSTEM.D)).stable


def growth(of, plant):
    """How the free response's size changes over 300 samples; small enough to meet no bound."""
    y, _ = fly(of, plant, 700, x=1e-9)
    return np.abs(y[600:]).max() / np.abs(y[300:400]).max()


@pytest.mark.parametrize(("system", "below"), [(SYSTEM, False), (UNSTABLE, True)], ids=["stable", "unstable by itself"])
def test_the_gain_margin_parts_plants_that_settle_from_plants_that_do_not(system, below):
    of = controller(system, disturbance_model="input" if below else "output")
    lowest, highest = analysis(of).gain_margin
    assert highest > 1
    assert (lowest > 0) == below
    margins = [(highest, 1), (lowest, -1)] if below else [(highest, 1)]
    for factor, outwards in margins:
        for beyond in (-1, 1):
            plant = system._replace(B=factor * (1 + 0.01 * beyond * outwards) * system.B)
            assert analysis(of, plant).stable == (beyond < 0)
            assert growth(of, plant) ** beyond > 1.1


@pytest.mark.parametrize("setting", SETTINGS)
def test_gains_at_rest_are_where_the_flown_loop_comes_to_rest(setting):
    of = controller(**SETTINGS[setting])
    m, k, samples = of.mpc.inputs, of.mpc.measured_disturbances, 1500
    told = analysis(of, OTHER)
    gains = {
        "reference": told.reference_gain,
        "on_y": told.output_disturbance_gain,
        "on_u": told.input_disturbance_gain,
        "w": told.measured_disturbance_gain,
    }
    sizes = {"reference": 2, "on_y": 2, "on_u": m, "w": k}
    for name, gain in gains.items():
        assert gain.shape == (2, sizes[name])
        for unit, column in zip(np.eye(sizes[name]), gain.T, strict=True):
            y, _ = fly(of, OTHER, samples, **{name: 0.01 * unit})
            np.testing.assert_allclose(y[-1], 0.01 * column, atol=1e-10)
    free = setting != "input weight"
    assert told.offset_free == free
    assert told.integral_action == free
    if free:
        np.testing.assert_allclose(told.reference_gain, np.eye(2), atol=1e-8)


def test_more_outputs_than_inputs_cannot_be_free_of_offset():
    single = SYSTEM._replace(B=SYSTEM.B[:, :1], D=SYSTEM.D[:, :1])
    told = analysis(controller(single))
    assert told.stable
    assert not told.offset_free
    assert np.linalg.matrix_rank(told.reference_gain, tol=1e-6) == 1


def test_inputs_whose_effects_cancel_are_told_from_the_modes_that_the_outputs_show():
    of = controller()
    told = analysis(of)
    y, _ = fly(of, SYSTEM, 401, reference=[0.01, 0.02], on_u=[1.0, 1.0, 1.0])
    assert told.loop.time_constant > 4 > 1 > told.output_time_constant
    # After 5 s the output has long settled.
    assert np.abs(y[100:] - [0.01, 0.02]).max() < 1e-5


def test_observability_does_not_depend_on_the_units_of_states():
    A, C = SYSTEM.A, SYSTEM.C
    units = np.diag([1e6, 1e-3, 1.0, 40.0])
    told = observability(A, C, 10)
    assert 0.1 < told <= 1
    assert observability(units @ A @ np.linalg.inv(units), C @ np.linalg.inv(units), 10) == pytest.approx(told)


@pytest.mark.parametrize(
    ("A", "C", "measure"),
    [
        (np.diag([0.9, 0.5, 3.0]), np.eye(3), 1.0),
        (np.diag([0.9, 0.9]), np.ones((1, 2)), 0.0),
        (np.diag([0.9, 0.8]), np.array([[1.0, 0.0]]), 0.0),
        # Columns (1, a, a^2 ...) and (1, b, b^2 ...), a = 0.6 and b = 0.8 after fading, have the cosine
        # sqrt((1 - a^2) (1 - b^2)) / (1 - a b) = 12/13, and the singular values sqrt(1 +- 12/13).
        (np.exp(1e-2) * np.diag([0.6, 0.8]), np.ones((1, 2)), np.sqrt((1 - 12 / 13) / (1 + 12 / 13))),
    ],
    ids=["all measured", "alike", "one unseen", "by hand"],
)
def test_observability_of_known_pairs(A, C, measure):
    assert observability(A, C, 100) == pytest.approx(measure, abs=1e-9)


def test_unstable_modes_are_those_that_need_the_inputs():
    A, B = block_diag(UNSTABLE.A, 0.5), np.vstack([UNSTABLE.B, 0])
    reached, unreached = unstable_part(A, B), unstable_part(block_diag(A, 1.1), np.vstack([B, 0]))
    np.testing.assert_allclose(np.diag(reached[0]), np.abs(np.linalg.eigvals(UNSTABLE.A)).max())
    assert len(unreached[0]) == 2
    assert observability(*reached, 10) == pytest.approx(1)
    assert observability(*unreached, 10) < 1e-9


def test_a_loop_that_is_not_stable_is_said_to_be_so():
    told = analysis(controller(UNSTABLE, terminal=None, horizon=1))
    assert told.unstable_modes == 1
    assert told.stabilisability == 1
    assert not told.stable
    assert told.loop.time_constant == np.inf
    assert [peak.gain for peak in (told.sensitivity, told.complementary, told.noise_to_input)] == [np.inf] * 3
    assert told.robust_error == 0
    assert np.isnan([*told.gain_margin, *told.reference_gain.ravel()]).all()
    assert not told.offset_free
    assert "UNSTABLE" in str(told).splitlines()[0]
    assert "UNSTABLE" in told.established[0]


def test_it_claims_of_stability_what_the_settings_allow():
    def claims(system=SYSTEM, plant=None, **settings):
        told = analysis(controller(system, **settings), plant)
        return " ".join(told.established), " ".join(told.not_established)

    yes, no = claims()
    assert "linear-quadratic" in yes
    assert "everything stays bounded" in yes
    assert "no terminal set" in no
    assert "robot" in no
    for settings in ({"terminal": None}, {"control_horizon": 9}):
        assert "linear-quadratic" not in claims(**settings)[0]
        assert "comes true" not in claims(**settings)[0]
    assert "blocks" in claims(control_horizon=9)[1]
    assert "bounded" not in claims(UNSTABLE)[0].replace("unbounded", "")
    assert "no input inside the bounds brings it back" in claims(UNSTABLE)[1]
    yes, no = claims(plant=SYSTEM._replace(B=10 * SYSTEM.B))
    assert "plant given is UNSTABLE" in yes
    assert "small-gain" not in no


@pytest.mark.parametrize("plant", [None, OTHER, SYSTEM._replace(B=10 * SYSTEM.B)], ids=["model", "other", "unstable"])
def test_it_prints_as_a_page(plant):
    lines = str(analysis(controller(), plant)).splitlines()
    assert len(lines) <= 34
    assert max(map(len, lines)) <= 120


def test_a_plant_that_does_not_fit_is_refused():
    of = controller()
    with pytest.raises(ValueError, match=r"plant's B has shape \(4, 2\), but \(4, 3\)"):
        analysis(of, SYSTEM._replace(B=SYSTEM.B[:, :2]))
    with pytest.raises(ValueError, match="plant's A is not finite"):
        analysis(of, SYSTEM._replace(A=np.full((4, 4), np.nan)))
    with pytest.raises(ValueError, match="plant's A has shape"):
        analysis(of, SYSTEM._replace(A=np.array(1.0)))
