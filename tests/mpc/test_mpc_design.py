"""The numbers of a controller: their layout, their derivatives in theta, what is refused."""

import casadi
import numpy as np
import pytest

from socasadi.model import Dense, Modal
from socasadi.mpc import DesignError, LinearMPC

THETA = np.array([4.6, 0.08, 6e-3, -3e-3, -3e-3, 5.2, 0.15, 0.5e-3, 5e-3, -5e-3])
SYSTEM = Modal().state_space(THETA, 0.05)
WITH_D = SYSTEM._replace(D=1e-3 * np.random.default_rng(3).normal(size=(2, 3)))
EVERYTHING = {
    "horizon": 8,
    "control_horizon": (1, 2, 5),
    "preview": 3,
    "rate_bounds": (-40, (30, np.inf, 30)),
    "output_bounds": (-0.05, (0.05, np.inf)),
    "slack_linear": 3.0,
    "delay": 2,
}


def test_the_parts_have_the_sizes_that_are_promised():
    design = LinearMPC(Modal(inputs=4), measured_disturbances=1, **EVERYTHING).design(
        Modal(inputs=4).state_space([*THETA[:5], 1e-3, *THETA[5:], -2e-3], 0.05)
    )
    ne, m, k, p, nz = 4 + 3 * 3 + 2, 3, 1, 2, 3 * 3
    parameters = ne + m + 3 * p + k + 1
    rows = nz + nz + (8 - 2) * p
    shapes = {
        **{"A": (ne, ne), "B": (ne, m), "E": (ne, k), "C": (p, ne), "D": (p, m), "F": (p, k)},
        **{"gain": (ne, p), "rest": (ne, m), "hessian": (nz, nz), "gradient": (nz, parameters)},
        **{"rows": (rows, nz), "row_free": (rows, parameters), "row_lower": (rows,), "row_upper": (rows,)},
        **{"quadratic": (rows,), "price": (rows,)},
    }
    for name, shape in shapes.items():
        assert getattr(design, name).shape == shape, name
    assert (design.order, design.inputs, design.outputs, design.disturbances, design.preview) == (ne, m, p, k, 3)
    assert design.parameters(np.zeros(ne), np.zeros(m), np.zeros((3, p)), [0.0]).shape == (parameters,)


def test_rows_are_the_box_then_the_rates_then_the_soft_outputs():
    design = LinearMPC(Modal(), **EVERYTHING).design(WITH_D)
    assert np.array_equal(design.rows[:9], np.eye(9))
    assert np.array_equal(design.row_free[:9], np.zeros_like(design.row_free[:9]))
    assert np.array_equal(design.row_upper[:9], np.ones(9))
    # Changes from move to move, in shares of 10 N a sample of 50 ms.
    v = np.array([0.1, 0.2, 0.3])
    parameters = design.parameters(np.zeros(design.order), v, np.zeros((3, 2)))
    moves = np.arange(1.0, 10.0)
    changes = design.rows[9:18] @ moves + design.row_free[9:18] @ parameters
    assert np.allclose(changes, moves - np.r_[v, moves[:6]])
    assert np.allclose(design.row_upper[9:12], [0.15, np.inf, 0.15])
    assert np.isinf(design.quadratic[:18]).all()
    assert np.array_equal(design.price[:18], np.zeros(18))
    # In metres, slack_weight s^2 + slack_linear s, where the unit of the row is 0.05 m.
    assert len(design.rows) == 18 + 2 * (8 - 2)
    assert np.allclose(design.quadratic[18:] / 2 / 0.05**2, 1e5)
    assert np.allclose(design.price[18:] / 0.05, 3.0)
    assert np.allclose(design.row_upper[18:22], [1, np.inf, 1, np.inf])


def test_the_output_rows_are_the_outputs_of_a_simulation():
    """In shares of the largest bound, from the first one on that the delay lets be moved."""
    mpc = LinearMPC(Modal(), **EVERYTHING)
    design, rng = mpc.design(WITH_D), np.random.default_rng(0)
    x, v, moves = 0.01 * rng.normal(size=design.order), rng.uniform(-1, 1, 3), rng.uniform(-1, 1, 9)
    state, outputs = x, []
    for move in np.repeat(moves.reshape(3, 3), mpc.blocks, axis=0):
        state = design.A @ state + design.B @ move
        outputs.append(design.C @ state + design.D @ move)
    rows = design.rows[18:] @ moves + design.row_free[18:] @ design.parameters(x, v, np.zeros((3, 2)))
    assert np.allclose(rows, np.ravel(outputs[2:]) / 0.05, rtol=0, atol=1e-12)


def test_an_input_bounded_nowhere_in_rate_has_no_rate_rows():
    design = LinearMPC(Modal(), rate_bounds=(-np.inf, (20, np.inf, np.inf)), output_bounds=None).design(SYSTEM)
    assert design.rows.shape == (30 + 10, 30)
    assert np.isneginf(design.row_lower[30:]).all()


@pytest.mark.parametrize("delay", [0, 1, 3])
def test_at_rest_nothing_moves(delay):
    design, v = LinearMPC(Modal(), delay=delay).design(WITH_D), np.array([0.3, -0.2, 0.1])
    x = design.rest @ v
    assert np.allclose(design.A @ x + design.B @ v, x, atol=1e-14)
    gain = SYSTEM.C @ np.linalg.solve(np.eye(4) - SYSTEM.A, SYSTEM.B) + WITH_D.D
    assert np.allclose(design.C @ x + design.D @ v, 10 * gain @ v, atol=1e-14)


@pytest.mark.parametrize("model", ["output", "input"])
def test_a_disturbance_is_counted_in_metres_of_output_at_rest(model):
    design, d = LinearMPC(Modal(), disturbance_model=model, delay=1).design(WITH_D), np.array([0.01, -0.02])
    x = np.zeros(design.order)
    for _ in range(2000):
        x[-2:] = d
        x = design.A @ x
    assert np.allclose(design.C @ x, d, atol=1e-9)


@pytest.mark.parametrize(
    ("bounds", "limit"),
    [((-0.1, 0.1), 1e3), ((-0.05, (0.2, np.inf)), 2e3), (None, 1e15), ((-640, 640), 6.4e6), ((0, np.inf), 1e4)],
)
def test_a_plausible_measurement_is_judged_by_the_bounds_of_the_outputs(bounds, limit):
    assert LinearMPC(Modal(), output_bounds=bounds).design(SYSTEM).plausible == pytest.approx(limit)


def test_parameters_take_the_input_before_at_its_bounds_and_refuse_other_sizes():
    design = LinearMPC(Modal(), input_bounds=(-2, 10), preview=2).design(SYSTEM)
    given = design.parameters(np.arange(6), [3.0, -3.0, 0.5], [[1, 2], [3, 4]])
    assert np.allclose(given, [*range(6), 1.0, -0.2, 0.5, 1, 2, 3, 4, 1])
    with pytest.raises(ValueError, match="reference has 2 values; this design takes 4"):
        design.parameters(np.zeros(6), np.zeros(3), [0, 0])
    with pytest.raises(ValueError, match="w has 1 values; this design takes 0"):
        design.parameters(np.zeros(6), np.zeros(3), np.zeros((2, 2)), [0])


@pytest.mark.parametrize(
    ("mpc", "theta"),
    [
        (LinearMPC(Modal(), measured_disturbances=1, disturbance_model="output", horizon=5, delay=1), THETA),
        (LinearMPC(Modal(), disturbance_model="input", horizon=5, control_horizon=2, rate_bounds=(-40, 40)), THETA),
        (LinearMPC(Modal(), input_term="normalised", horizon=4), THETA),
        (LinearMPC(Dense(order=3, feedthrough=True, inputs=2), horizon=4, disturbance_model="input", delay=2), None),
    ],
    ids=["measured, delayed", "input disturbance", "normalised", "with D"],
)
def test_the_formulation_is_differentiable_in_theta(mpc, theta):
    """Against central differences, every number of the controller."""
    if theta is None:
        rng = np.random.default_rng(1)
        theta = np.array([np.sqrt(e.lower * e.upper) if e.scale == "log" else 0.3 * e.upper for e in mpc.model.entries])
        theta = theta * rng.uniform(0.8, 1.2, len(theta))
    symbol = casadi.MX.sym("theta", mpc.model.size)
    numbers = mpc.formulation(symbol)
    names = [name for name in mpc.formulation.name_out() if name not in ("row_lower", "row_upper", "quadratic")]
    outputs = casadi.vertcat(*[casadi.vec(numbers[mpc.formulation.index_out(name)]) for name in names[:-1]])
    rng = np.random.default_rng(2)
    direction = theta * rng.normal(size=len(theta))
    at = casadi.Function("at", [symbol], [outputs])
    slope = casadi.Function("slope", [symbol], [casadi.jtimes(outputs, symbol, casadi.DM(direction))])(theta)
    differences = (at(theta + 1e-4 * direction) - at(theta - 1e-4 * direction)) / 2e-4
    slope, differences = slope.full().ravel(), differences.full().ravel()
    assert np.abs(slope).max() > 0.1
    assert np.allclose(slope, differences, rtol=1e-4, atol=1e-6 * np.abs(slope).max())


def test_the_formulation_is_the_design_of_the_model():
    mpc = LinearMPC(Modal(), **EVERYTHING)
    numbers, design = mpc.formulation.call([THETA]), mpc.design(SYSTEM)
    for name, number in zip(mpc.formulation.name_out()[:-1], numbers, strict=False):
        wanted = np.reshape(getattr(design, name), number.shape)
        assert np.allclose(number.full(), wanted, rtol=1e-9, atol=1e-12), name


@pytest.mark.parametrize("unit", [1e-3, 1e3, 1e6])
def test_the_unit_of_the_outputs_does_not_matter(unit):
    """Metres, or pixels: with weights, bounds and noises in the same unit the tensions are the same."""
    scaled = WITH_D._replace(C=unit * WITH_D.C, D=unit * WITH_D.D)
    for model in ("output", "input"):
        metres = LinearMPC(Modal(), disturbance_model=model, slack_linear=10.0)
        other = LinearMPC(
            Modal(),
            disturbance_model=model,
            Q=1e3 / unit**2,
            slack_weight=1e5 / unit**2,
            slack_linear=10.0 / unit,
            output_bounds=(-0.1 * unit, 0.1 * unit),
            measurement_noise=1e-3 * unit,
            disturbance_noise=1e-3 * unit,
        )
        one, two = metres.controller_for(WITH_D), other.controller_for(scaled)
        for y, wanted in ([0.01, -0.02], [0.03, 0.12]), ([0.02, 0.01], [-0.2, 0.05]):
            u = one.step(y, wanted)
            assert np.allclose(u, two.step(unit * np.array(y), unit * np.array(wanted)), rtol=0, atol=1e-6)


def test_a_disturbance_at_inputs_that_do_not_reach_every_output_is_refused():
    """It could not be told from nothing. At the outputs it can."""
    deaf = SYSTEM._replace(B=SYSTEM.B * [[1], [1], [0], [0]])
    with pytest.raises(DesignError, match="the model gives no controller"):
        LinearMPC(Modal(), disturbance_model="input").design(deaf)
    LinearMPC(Modal(), disturbance_model="output").design(deaf)
