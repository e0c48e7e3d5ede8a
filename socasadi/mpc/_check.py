"""What is wrong with a specification, in one sentence that names the setting and its value."""

from numbers import Integral
from typing import TYPE_CHECKING

import numpy as np

from ..model import PredictionModel
from .formulation import block_lengths, check_input_term, positive_numbers, weight_matrix
from .solvers import check_backend

if TYPE_CHECKING:
    from ._spec import LinearMPC


def check_settings(mpc: "LinearMPC") -> None:
    """TypeError or ValueError for the first setting that is out of its range."""
    if not isinstance(mpc.model, PredictionModel):
        raise TypeError(f"model is a prediction-model family such as Modal(), not {mpc.model!r}")
    if not _is_count(mpc.horizon, 1):
        raise ValueError(f"horizon is a positive number of samples, not {mpc.horizon!r}")
    if not (isinstance(mpc.sample_time, int | float | np.number) and 0 < mpc.sample_time < np.inf):
        raise ValueError(f"sample_time must be positive, not {mpc.sample_time!r}")
    block_lengths(mpc.control_horizon, mpc.horizon)
    if mpc.preview is not None and not (_is_count(mpc.preview, 1) and mpc.preview <= mpc.horizon):
        raise ValueError(
            f"preview is a number of rows from 1 to the horizon, {mpc.horizon}, or None, not {mpc.preview!r}"
        )
    if not (_is_count(mpc.delay, 0) and mpc.delay < mpc.horizon):
        raise ValueError(f"delay is a number of samples from 0 to below the horizon, {mpc.horizon}, not {mpc.delay!r}")
    if not (_is_count(mpc.measured_disturbances, 0) and mpc.measured_disturbances < mpc.model.inputs):
        raise ValueError(
            f"measured_disturbances is how many of the model's {mpc.model.inputs} inputs are measured and not "
            f"tensions, at least one less than all, not {mpc.measured_disturbances!r}"
        )
    if mpc.iteration_limit is not None and not _is_count(mpc.iteration_limit, 1):
        raise ValueError(f"iteration_limit is a positive number of iterations or None, not {mpc.iteration_limit!r}")
    check_input_term(mpc.input_term)
    check_backend(mpc.backend)
    if mpc.terminal not in ("riccati", None):
        raise ValueError(f"terminal is 'riccati' or None, not {mpc.terminal!r}")
    if mpc.disturbance_model not in ("output", "input"):
        raise ValueError(f"disturbance_model is 'output' or 'input', not {mpc.disturbance_model!r}")
    if mpc.disturbance_model == "input" and mpc.inputs < mpc.outputs:
        raise ValueError(
            f"disturbance_model 'input' needs as many inputs as outputs; there are {mpc.inputs} and {mpc.outputs}: "
            "take 'output'"
        )
    weight_matrix(mpc.Q, mpc.outputs, "Q")
    if np.linalg.eigvalsh(weight_matrix(mpc.R, mpc.inputs, "R"))[0] <= 0:
        raise ValueError(f"R must be positive definite, not {mpc.R}: the input would be undetermined")
    weight_matrix(mpc.rate_weight, mpc.inputs, "rate_weight")
    positive_numbers(mpc.slack_weight, mpc.outputs, "slack_weight")
    positive_numbers(mpc.slack_linear, mpc.outputs, "slack_linear", zero=True)
    _ = mpc.input_limits, mpc.rate_limits, mpc.output_limits, mpc.noise


def _is_count(value: object, least: int) -> bool:
    return isinstance(value, Integral) and not isinstance(value, bool) and int(value) >= least
