"""What is refused, in one sentence that names the value, and what is taken in more than one form."""

import pickle

import numpy as np
import pytest

from socasadi.model import Dense, Modal
from socasadi.mpc import Controller, LinearMPC, weight_matrix

THETA = np.array([4.6, 0.08, 6e-3, -3e-3, -3e-3, 5.2, 0.15, 0.5e-3, 5e-3, -5e-3])


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ({"horizon": 0}, "horizon is a positive number of samples, not 0"),
        ({"horizon": 2.5}, "horizon is a positive number of samples, not 2.5"),
        ({"sample_time": 0.0}, "sample_time must be positive, not 0.0"),
        ({"sample_time": np.nan}, "sample_time must be positive, not nan"),
        ({"slack_weight": -1.0}, "slack_weight must be positive, not -1.0"),
        ({"measurement_noise": 0.0}, "measurement_noise must be positive, not 0.0"),
        ({"input_noise": np.inf}, "input_noise must be positive, not inf"),
        ({"disturbance_noise": 0.0}, "disturbance_noise must be positive, not 0.0"),
        ({"input_term": "newtons"}, "unknown input_term 'newtons'; there are rate, normalised, literal"),
        ({"backend": "gurobi"}, "unknown QP back end 'gurobi'; there are"),
        ({"terminal": "zero"}, "terminal is 'riccati' or None, not 'zero'"),
        ({"Q": (1.0, 2.0, 3.0)}, r"Q is a number, 2 numbers or a \(2, 2\) matrix, not of shape \(3,\)"),
        ({"Q": -1.0}, "Q must be positive semidefinite, not -1.0"),
        ({"Q": ((1.0, 0.5), (0.0, 1.0))}, "Q must be finite and symmetric"),
        ({"R": np.nan}, "R must be finite and symmetric, not nan"),
        ({"R": 0.0}, "R must be positive definite, not 0.0"),
        ({"R": (1.0, 0.0, 1.0)}, r"R must be positive definite"),
        ({"input_bounds": (10, -10)}, "input_bounds cross: lower 10 is not below upper -10"),
        ({"input_bounds": ((-1, -1, 5), (1, 1, 5))}, "input_bounds cross: lower 5 is not below upper 5"),
        ({"input_bounds": (-10, np.inf)}, "input_bounds must be finite"),
        ({"input_bounds": (-10, 0, 10)}, r"input_bounds is a pair \(lower, upper\) of numbers or of 3 numbers each"),
        ({"input_bounds": ((-1, -1), (1, 1))}, r"input_bounds is a pair"),
        ({"input_bounds": 10.0}, r"input_bounds is a pair"),
        ({"input_bounds": None}, r"input_bounds is a pair"),
        ({"output_bounds": (0.1, -0.1)}, "output_bounds cross: lower 0.1 is not below upper -0.1"),
        ({"output_bounds": (np.nan, 0.1)}, "output_bounds must be finite, or infinite where there is no bound"),
        ({"output_bounds": (-np.inf, np.inf)}, r"output_bounds \(-inf, inf\) bound nothing: give None"),
        ({"horizon": True}, "horizon is a positive number of samples, not True"),
        ({"control_horizon": 0}, "control_horizon is a number of moves from 1 to the horizon, 10, not 0"),
        ({"control_horizon": 11}, "control_horizon is a number of moves from 1 to the horizon, 10, not 11"),
        ({"control_horizon": 2.0}, "control_horizon is a number of moves, the lengths of blocks .*, not 2.0"),
        ({"control_horizon": (1, 2, 3)}, r"add up to the horizon, 10 samples; \(1, 2, 3\) add up to 6"),
        ({"control_horizon": (0, 10)}, r"control_horizon is .* lengths of blocks .*, not \(0, 10\)"),
        ({"control_horizon": ()}, r"add up to the horizon, 10 samples; \(\) add up to 0"),
        ({"preview": 0}, "preview is a number of rows from 1 to the horizon, 10, or None, not 0"),
        ({"preview": 11}, "preview is a number of rows from 1 to the horizon, 10, or None, not 11"),
        ({"rate_weight": -1.0}, "rate_weight must be positive semidefinite, not -1.0"),
        ({"rate_weight": (1.0, 2.0)}, r"rate_weight is a number, 3 numbers or a \(3, 3\) matrix, not of shape \(2,\)"),
        ({"rate_bounds": 20.0}, r"rate_bounds is a pair \(lower, upper\) of numbers or of 3 numbers each, not 20.0"),
        ({"rate_bounds": (5, 20)}, r"rate_bounds must have 0 between them, not \(5, 20\): a tension may be held"),
        ({"rate_bounds": (-20, (10, -5, 10))}, "rate_bounds must have 0 between them"),
        ({"rate_bounds": (0, 0)}, "rate_bounds cross: lower 0 is not below upper 0"),
        ({"rate_bounds": (np.nan, 20)}, "rate_bounds must be finite, or infinite where there is no bound"),
        ({"slack_weight": (1e5, 0.0)}, r"slack_weight must be positive, not \(100000.0, 0.0\)"),
        ({"slack_weight": (1.0, 2.0, 3.0)}, r"slack_weight is a number or 2 numbers, not \(1.0, 2.0, 3.0\)"),
        ({"slack_linear": -1.0}, "slack_linear must be zero or positive, not -1.0"),
        ({"slack_linear": "much"}, "slack_linear is a number or 2 numbers, not 'much'"),
        ({"disturbance_model": "state"}, "disturbance_model is 'output' or 'input', not 'state'"),
        (
            {"disturbance_model": "input", "measured_disturbances": 2},
            "'input' needs as many inputs as outputs; .* 1 and 2",
        ),
        ({"measured_disturbances": 3}, "measured_disturbances is how many of the model's 3 inputs .*, not 3"),
        ({"measured_disturbances": -1}, "measured_disturbances is how many of the model's 3 inputs .*, not -1"),
        ({"measured_disturbances": 1, "input_bounds": ((-1, -1, -1), (1, 1, 1))}, "of numbers or of 2 numbers each"),
        ({"delay": -1}, "delay is a number of samples from 0 to below the horizon, 10, not -1"),
        ({"delay": 10}, "delay is a number of samples from 0 to below the horizon, 10, not 10"),
        ({"delay": 0.5}, "delay is a number of samples from 0 to below the horizon, 10, not 0.5"),
        ({"measurement_noise": (1e-3, 0.0)}, r"measurement_noise must be positive, not \(0.001, 0.0\)"),
        ({"measurement_noise": (1e-3,) * 3}, r"is a standard deviation, 2 of them or a \(2, 2\) covariance matrix"),
        ({"measurement_noise": ((1.0, 1.0), (1.0, 1.0))}, "measurement_noise must be positive definite"),
        ({"input_noise": np.eye(2)}, r"input_noise is a number, 3 numbers or a \(3, 3\) matrix, not of shape \(2, 2\)"),
        ({"input_noise": -np.eye(3)}, "input_noise must be positive semidefinite"),
        ({"disturbance_noise": ((1.0, 0.5), (0.0, 1.0))}, "disturbance_noise must be finite and symmetric"),
        ({"disturbance_noise": "small"}, "disturbance_noise is a standard deviation, 2 of them .*, not 'small'"),
    ],
)
def test_a_wrong_setting_is_refused(settings, said):
    with pytest.raises(ValueError, match=said):
        LinearMPC(Modal(), **settings)


def test_a_model_that_is_no_family_is_refused():
    with pytest.raises(TypeError, match=r"model is a prediction-model family such as Modal\(\), not 'modal'"):
        LinearMPC("modal")  # pyright: ignore[reportArgumentType]


@pytest.mark.parametrize(
    ("theta", "said"),
    [(np.ones(9), r"theta has shape \(9,\)"), (np.full(10, np.nan), "theta must be finite, but freq")],
)
def test_a_wrong_theta_is_refused(theta, said):
    with pytest.raises(ValueError, match=said):
        LinearMPC(Modal()).controller(theta)


def test_a_specification_with_arrays_keeps_no_arrays():
    """It is a value: equal to another of equal settings, a key, and what is written into a journal."""
    given = LinearMPC(Modal(), rate_bounds=(np.full(3, -5.0), np.full(3, 5.0)), input_noise=np.eye(3))
    assert given.rate_bounds == ((-5.0,) * 3, (5.0,) * 3)
    assert given == LinearMPC(Modal(), rate_bounds=([-5.0] * 3, [5.0] * 3), input_noise=np.eye(3).tolist())
    assert given.formulation.name_in() == ["theta"]
    given.controller(THETA)
    assert pickle.loads(pickle.dumps(given)) == given


@pytest.mark.parametrize(
    ("control_horizon", "blocks"),
    [(None, (1,) * 10), (1, (10,)), (3, (1, 1, 8)), ([2, 3, 5], (2, 3, 5)), (np.array([4, 6]), (4, 6))],
)
def test_a_control_horizon_is_a_number_of_moves_or_the_lengths_of_blocks(control_horizon, blocks):
    assert LinearMPC(Modal(), control_horizon=control_horizon).blocks == blocks


@pytest.fixture
def controller() -> Controller:
    controller = LinearMPC(Modal()).controller(THETA)
    controller.step([0.001, 0.0], [0.02, 0.0])
    return controller


@pytest.mark.parametrize(
    ("y", "reference", "said"),
    [
        ([0, 0, 0], [0, 0], r"y has shape \(3,\); this controller takes \(2,\)"),
        (0.0, [0, 0], r"y has shape \(\)"),
        ([np.nan, 0], [0, 0], "y must be finite, not .*nan"),
        ([0, np.inf], [0, 0], "y must be finite, not .*inf"),
        ([0, 0], [0, 0, 0], r"reference has shape \(3,\); this controller takes \(2,\) or a preview \(k, 2\)"),
        ([0, 0], np.zeros((0, 2)), r"reference has shape \(0, 2\)"),
        ([0, 0], np.zeros((2, 3)), r"reference has shape \(2, 3\)"),
        ([0, 0], np.zeros((1, 2, 2)), r"reference has shape \(1, 2, 2\)"),
        ([0, 0], [0, np.nan], "reference must be finite"),
        ([0, 0], [[0, 0], [np.inf, 0]], "reference must be finite"),
    ],
)
def test_a_refused_sample_leaves_the_controller_as_it_was(controller, y, reference, said):
    twin = LinearMPC(Modal()).controller(THETA)
    twin.step([0.001, 0.0], [0.02, 0.0])
    with pytest.raises(ValueError, match=said):
        controller.step(y, reference)
    assert controller.info.steps == 1
    assert np.array_equal(controller.step([0.002, 0.001], [0.02, 0.0]), twin.step([0.002, 0.001], [0.02, 0.0]))


@pytest.mark.parametrize("u_prev", [np.nan, [1, 2], [1, 2, np.inf], np.zeros((3, 1))])
def test_a_wrong_start_is_refused(controller, u_prev):
    with pytest.raises(ValueError, match=r"u_prev is a finite number or \(3,\) of them"):
        controller.reset(u_prev)
    assert controller.info.steps == 1


@pytest.mark.parametrize(
    "settings",
    [
        {"Q": [1e3, 1e3], "R": [1.0, 1.0, 1.0]},
        {"Q": np.diag([1e3, 1e3]), "R": np.eye(3)},
        {"Q": np.full(2, 1e3), "R": [[1, 0, 0], [0, 1, 0], [0, 0, 1]]},
        {"input_bounds": [-10, 10], "output_bounds": [-0.1, 0.1]},
        {"input_bounds": (np.full(3, -10), [10, 10, 10]), "output_bounds": (np.full(2, -0.1), 0.1)},
        {"control_horizon": 10, "preview": 10},
        {"control_horizon": [1] * 10, "rate_weight": np.zeros((3, 3)), "slack_weight": [1e5, 1e5]},
        {"slack_linear": (0, 0), "rate_bounds": (-np.inf, np.inf)},
        {"measurement_noise": [1e-3, 1e-3], "input_noise": np.full(3, 0.5), "disturbance_noise": 1e-6 * np.eye(2)},
        {
            "measurement_noise": [[1e-6, 0], [0, 1e-6]],
            "input_noise": np.diag([0.25] * 3),
            "disturbance_noise": (1e-3,) * 2,
        },
    ],
)
def test_lists_arrays_and_numbers_mean_the_same(settings):
    given = LinearMPC(Modal(), **settings)
    assert hash(given) is not None
    assert np.allclose(
        given.controller(THETA).step([0, 0], [0.03, 0.01]),
        LinearMPC(Modal()).controller(THETA).step([0, 0], [0.03, 0.01]),
        rtol=1e-10,
    )


def test_specifications_with_equal_arrays_are_equal():
    assert LinearMPC(Modal(), Q=np.eye(2)) == LinearMPC(Modal(), Q=np.eye(2))
    assert LinearMPC(Modal(), Q=np.eye(2)) != LinearMPC(Modal(), Q=2 * np.eye(2))
    assert LinearMPC(Modal()) != LinearMPC(Dense())


def test_weights_in_their_three_forms():
    assert np.array_equal(weight_matrix(2.0, 2, "Q"), [[2, 0], [0, 2]])
    assert np.array_equal(weight_matrix((1.0, 3.0), 2, "Q"), [[1, 0], [0, 3]])
    assert np.array_equal(weight_matrix([[2, 1], [1, 3]], 2, "Q"), [[2, 1], [1, 3]])


@pytest.mark.parametrize("bounds", [(0, 10), (-10, 0), (-10, 10), (-3, 10)])
def test_the_input_is_scaled_by_the_larger_bound(bounds):
    assert np.array_equal(LinearMPC(Modal(), input_bounds=bounds).input_scale, [10, 10, 10])
