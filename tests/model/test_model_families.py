"""Prediction-model families: what theta means, checked against scipy and by hand."""

import dataclasses
import warnings

import casadi
import numpy as np
import pytest
from scipy.linalg import expm
from scipy.signal import cont2discrete

from socasadi.model import Dense, Entry, Modal

T = 0.05
ORDERS = {2: 10, 3: 15, 4: 20}


def generic_theta(model, seed=0):
    """A point well inside the family's box."""
    share = np.random.default_rng(seed).uniform(0.2, 0.8, model.size)
    return np.array(
        [
            e.lower * (e.upper / e.lower) ** s if e.scale == "log" else e.lower + s * (e.upper - e.lower)
            for e, s in zip(model.entries, share, strict=True)
        ]
    )


def continuous_oscillators(theta, inputs):
    A, B, C = [], [], []
    for frequency, ratio, *gains in np.reshape(theta, (-1, 2 + inputs)):
        A.append([[0, 1], [-(frequency**2), -2 * ratio * frequency]])
        B += [[0.0] * inputs, [frequency**2 * gain for gain in gains]]
        C.append([[1.0, 0.0]])
    diagonal = lambda blocks: casadi.diagcat(*[casadi.DM(block) for block in blocks]).full()  # noqa: E731
    return diagonal(A), np.array(B), diagonal(C)


def markov(A, B, C, D, count=8):
    return np.array([D, *(C @ np.linalg.matrix_power(A, k) @ B for k in range(count))])


@pytest.mark.parametrize("ratios", [(0.05, 0.3), (0.9, 1.7), (4.0, 0.02)])
@pytest.mark.parametrize("sample_time", [0.01, 0.05, 0.4])
def test_modal_is_the_oscillators_with_the_input_held(ratios, sample_time):
    theta = [4.6, ratios[0], 5e-3, -2e-3, -3e-3, 7.1, ratios[1], 1e-3, 4e-3, -4e-3]
    A, B, C = continuous_oscillators(theta, 3)
    exact = cont2discrete((A, B, C, np.zeros((2, 3))), sample_time, method="zoh")
    for ours, theirs in zip(Modal().state_space(theta, sample_time), exact, strict=False):
        assert np.allclose(ours, theirs, rtol=1e-10, atol=1e-13)


@pytest.mark.parametrize("ratio", [1 - 1e-6, 1 - 1e-12, 1.0, 1 + 1e-12, 1 + 1e-6])
def test_modal_has_no_seam_at_critical_damping(ratio):
    model = Modal(axes=1, inputs=1)
    A = continuous_oscillators([6.0, ratio, 1.0], 1)[0]
    assert np.allclose(model.state_space([6.0, ratio, 1.0], T).A, expm(A * T), rtol=0, atol=2e-10)
    slope = casadi.Function("slope", [x := casadi.SX.sym("x", 3)], [casadi.jacobian(model.matrices(T)(x)[0], x)])
    assert np.isfinite(slope([6.0, ratio, 1.0]).full()).all()


@pytest.mark.parametrize(("axes", "inputs"), [(1, 1), (2, 3), (3, 4)])
def test_modal_rests_at_gain_times_input(axes, inputs):
    model = Modal(axes=axes, inputs=inputs)
    theta = generic_theta(model)
    A, B, C, D = model.state_space(theta, T)
    gain = C @ np.linalg.solve(np.eye(model.order) - A, B) + D
    assert model.size == axes * (2 + inputs)
    assert np.allclose(gain, np.reshape(theta, (axes, -1))[:, 2:], rtol=1e-9, atol=1e-15)


def test_modal_from_a_data_sheet_is_the_clamped_beam():
    # A round rod of radius 30 mm, E = 1 MPa, 1000 kg/m3, 0.6 m long, cables at 20 mm: 0.7373 Hz by Euler-Bernoulli, and
    # the small-deflection tip of one cable at 1 N, d L^2 / (2 EI), which is along y for a cable at +y and along
    # (-1, sqrt(3))/2 for one 120 degrees from there.
    area, inertia = np.pi * 0.03**2, np.pi * 0.03**4 / 4
    model = Modal.from_spec(
        length=0.6, bending_stiffness=1e6 * inertia, mass_per_length=1e3 * area, cable_offset=0.02, margin=1.5
    )
    gain = 0.02 * 0.36 / (2 * 1e6 * inertia)
    toward = {"y": [1, -0.5, -0.5], "z": [0, np.sqrt(0.75), -np.sqrt(0.75)]}
    for axis, entries in (("y", model.entries[:5]), ("z", model.entries[5:])):
        frequency, ratio, *gains = entries
        assert frequency.name == f"frequency_{axis}"
        assert (frequency.lower * 1.5, frequency.upper / 1.5) == pytest.approx([2 * np.pi * 0.7373] * 2, rel=1e-4)
        assert (ratio.lower, ratio.upper) == (0.02, 0.5)
        middle, half = (np.array([sign * e.lower + e.upper for e in gains]) / 2 for sign in (1, -1))
        assert middle == pytest.approx(gain * np.array(toward[axis]), rel=1e-9, abs=1e-15)
        assert half == pytest.approx(gain * (1 - 1 / 1.5), rel=1e-9)


def test_modal_from_a_data_sheet_follows_the_cables_round_the_section():
    sheet = {"length": 0.6, "bending_stiffness": 0.6, "mass_per_length": 2.8, "cable_offset": 0.02}
    model = Modal.from_spec(**sheet, cable_angles=(90.0, 180.0))
    gains = {entry.name: (entry.lower + entry.upper) / 2 for entry in model.entries if entry.unit == "m/N"}
    one = 0.02 * 0.36 / (2 * 0.6)
    expected = {"gain_y1": 0, "gain_y2": -one, "gain_z1": one, "gain_z2": 0}
    assert model.inputs == 2
    assert gains == pytest.approx(expected, abs=1e-15)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"length": 0.0}, "length must be positive, not 0.0"),
        ({"bending_stiffness": np.nan}, "bending_stiffness must be positive, not nan"),
        ({"margin": 1.0}, "margin is a factor above 1, not 1.0"),
        ({"damping_ratio": (0.5, 0.1)}, "bounds of damping_ratio_y must ascend: lower 0.5 is not below upper 0.1"),
    ],
)
def test_a_wrong_data_sheet_is_refused(change, said):
    sheet = {"length": 0.6, "bending_stiffness": 0.6, "mass_per_length": 2.8, "cable_offset": 0.02}
    with pytest.raises(ValueError, match=said):
        Modal.from_spec(**{**sheet, **change})


@pytest.mark.parametrize(("order", "size"), ORDERS.items())
def test_dense_has_as_many_entries_as_its_order_asks_for(order, size):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert Dense(order=order).size == size
    with (
        pytest.warns(UserWarning, match=f"theta of this Dense model has {size + 6} entries")
        if size + 6 > 20
        else (warnings.catch_warnings())
    ):
        assert Dense(order=order, feedthrough=True).size == size + 6


def test_the_warning_of_a_long_theta_points_at_who_asked():
    with pytest.warns(UserWarning, match="26 entries") as said:
        Dense(feedthrough=True)
    assert said[0].filename == __file__


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("feedthrough", [False, True])
@pytest.mark.filterwarnings("ignore:theta of this Dense")
def test_dense_has_no_redundant_direction(order, feedthrough):
    """No change of theta leaves the impulse response as it is, so theta is no longer than it must be."""
    model = Dense(order=order, feedthrough=feedthrough)
    theta = casadi.SX.sym("theta", model.size)
    A, B, C, D = model.matrices(T)(theta)
    response = casadi.vertcat(*[casadi.vec(C @ casadi.mpower(A, k) @ B) for k in range(2 * order)], casadi.vec(D))
    slope = casadi.Function("slope", [theta], [casadi.jacobian(response, theta)])
    at = generic_theta(model)
    values = np.linalg.svd(slope(at).full() * at, compute_uv=False)
    assert values[-1] > 1e-6 * values[0]


@pytest.mark.parametrize("order", ORDERS)
def test_dense_reaches_any_observable_model_of_its_order(order):
    """A random model, brought into the form by a change of coordinates, is the model of some theta."""
    rng = np.random.default_rng(order)
    model = Dense(order=order)
    A = np.eye(order) + T * rng.uniform(-3, 3, (order, order))
    B, C = T * rng.normal(size=(order, 3)), rng.normal(size=(2, order))
    # The form's states are the outputs and the forward differences of the first ones, with the input at zero.
    into = np.vstack([C, (C @ (A - np.eye(order)) / T)[: order - 2]])
    A_form, B_form = into @ A @ np.linalg.inv(into), into @ B
    # By hand: the free rows of (A - I)/T, row by row, then all of B/T, with the restoring entries' signs turned.
    free = np.concatenate([((A_form - np.eye(order)) / T)[order - 2 :].ravel(), (B_form / T).ravel()])
    theta = free * [-1 if entry.name.startswith("-") else 1 for entry in model.entries]
    assert np.allclose(markov(*model.state_space(theta, T)), markov(A, B, C, np.zeros((2, 3))), rtol=1e-8, atol=1e-11)


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.filterwarnings("ignore:theta of this Dense")
def test_dense_measures_its_first_states_and_passes_d_on(order):
    model = Dense(order=order, feedthrough=True)
    theta = generic_theta(model)
    system = model.state_space(theta, T)
    assert np.array_equal(system.C, np.eye(2, order))
    assert np.array_equal(system.D, theta[-6:].reshape(2, 3))
    assert np.array_equal(Dense(order=order).state_space(theta[:-6], T).D, np.zeros((2, 3)))


def test_dense_of_order_four_holds_the_modal_one():
    """Two oscillators have a model of the form, since the form can be any observable model."""
    theta = np.array([4.6, 0.08, 5e-3, -2e-3, -3e-3, 7.1, 0.2, 1e-3, 4e-3, -4e-3])
    system = Modal().state_space(theta, T)
    into = np.vstack([system.C, system.C @ (system.A - np.eye(4)) / T])
    A_form = (into @ system.A @ np.linalg.inv(into) - np.eye(4)) / T
    assert np.allclose(A_form[:2], np.eye(2, 4, k=2), atol=1e-9)
    box = {e.name: (e.lower, e.upper) for e in Dense().entries}
    for row, column in [(2, 0), (3, 1), (2, 2), (3, 3)]:
        lower, upper = box[f"-Ad[{row + 1},{column + 1}]"]
        assert lower < -A_form[row, column] < upper


@pytest.mark.parametrize("model", [Modal(), Modal(axes=3, inputs=4), *(Dense(order=n) for n in ORDERS)], ids=str)
def test_entries_are_named_once_and_carry_a_unit(model):
    names = [entry.name for entry in model.entries]
    assert len(set(names)) == model.size
    assert {entry.unit for entry in model.entries} <= {"1", "rad/s", "m/N", "1/s", "1/s2", "m/(s N)", "m/(s2 N)"}
    assert model.matrices(T).numel_in(0) == model.size
    assert model.matrices(T) is model.matrices(T)


@pytest.mark.parametrize(
    ("theta", "said"),
    [
        (np.ones(9), r"theta has shape \(9,\); this Modal takes \(10,\)"),
        (np.ones((10, 1)), r"theta has shape \(10, 1\)"),
        ([4, 0.1, 0, 0, np.nan, 4, 0.1, 0, 0, 0], "theta must be finite, but gain_y3 is nan"),
        ([4, np.inf, 0, 0, 0, 4, 0.1, 0, 0, 0], "theta must be finite, but damping_ratio_y is inf"),
    ],
)
def test_a_wrong_theta_is_refused_by_name(theta, said):
    for method in (Modal().check, lambda t: Modal().state_space(t, T)):
        with pytest.raises(ValueError, match=said):
            method(theta)


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: Modal(axes=0), "axes of Modal is a positive integer, not 0"),
        (lambda: Modal(inputs=2.0), "inputs of Modal is a positive integer, not 2.0"),
        (lambda: Dense(order=5), "order of a Dense model with 2 axes lies between 2 and 4, not 5"),
        (lambda: Dense(order=1), "lies between 2 and 4, not 1"),
        (lambda: Modal(bounds=((1, 2),) * 9), "bounds hold 9 pairs, but theta of this Modal has 10 entries"),
        (lambda: Modal().with_bounds([(1, 2, 3)] * 10), "bounds hold one pair"),
        (lambda: Modal().with_bounds([(2, 1)] * 10), "bounds of frequency_y must ascend: lower 2 is not below upper 1"),
        (lambda: Modal().with_bounds([(2, 3), (0, 1)] * 5), "damping_ratio_y must be positive on a log scale"),
        (lambda: Modal().with_bounds([(2, np.inf)] * 10), "bounds of frequency_y must be finite"),
        (lambda: Entry("a", "m", 0, 1, "cubic"), "scale of a is 'linear' or 'log', not 'cubic'"),  # pyright: ignore
        (lambda: Modal().matrices(0.0), "sample_time must be positive, not 0.0 s"),
        (lambda: Modal().matrices(np.nan), "sample_time must be positive, not nan s"),
    ],
)
def test_wrong_settings_are_refused(make, said):
    with pytest.raises(ValueError, match=said):
        make()


def test_another_box_is_the_same_family():
    box = np.column_stack([np.full(10, 0.5), np.full(10, 0.6)])
    narrow = dataclasses.replace(Modal(), bounds=box)
    assert all((entry.lower, entry.upper) == (0.5, 0.6) for entry in narrow.entries)
    assert [(e.name, e.unit, e.scale) for e in narrow.entries] == [(e.name, e.unit, e.scale) for e in Modal().entries]
    assert narrow == Modal().with_bounds([(0.5, 0.6)] * 10)
    assert np.array_equal(narrow.state_space(np.full(10, 0.5), T).A, Modal().state_space(np.full(10, 0.5), T).A)
