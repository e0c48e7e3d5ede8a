"""How good a theta is as a model of a record, and the theta that is best in that sense."""

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import least_squares

from ._base import PredictionModel, StateSpace
from ._record import Record


def prediction_error(model: PredictionModel, theta: ArrayLike, record: Record) -> float:
    """Open-loop prediction error of ``theta`` on ``record``: root mean square over samples of the distance, m.

    The model runs from its first state through the whole record with no correction by measurements. The first state
    is the one that fits best in the least-squares sense, so that a record need not start at rest. Infinite when the
    prediction overflows.
    """
    _check_fit(model, record)
    return state_space_error(model.state_space(theta, record.sample_time), record)


def state_space_error(system: StateSpace, record: Record) -> float:
    """:func:`prediction_error` of a model that is given as it is."""
    return float(np.sqrt(np.mean(np.sum(_residual(system, record) ** 2, axis=1))))


def identify(
    model: PredictionModel, record: Record, *, starts: int = 4, within_bounds: bool = True, seed: int = 0
) -> np.ndarray:
    """theta (size,) of the least open-loop prediction error on ``record`` (output-error method).

    Nonlinear least squares (trust region reflective) from the best of 128 Sobol points.

    Parameters
    ----------
    starts
        Number of local searches.
    within_bounds
        Whether theta stays inside the model's bounds; without, only the entries on a log scale stay positive.
    seed
        Of the start points.

    Raises
    ------
    ValueError
        The record has other numbers of inputs or outputs than the model, or its tensions do not vary independently.
    """
    _check_fit(model, record)
    if model.size == 0:
        return np.zeros(0)
    varied = np.linalg.matrix_rank(record.tension - record.tension.mean(axis=0))
    if varied < model.inputs:
        raise ValueError(
            f"the record's tensions vary in {varied} independent ways, but gains of {model.inputs} inputs are sought: "
            "move every cable on its own, as probe() does"
        )
    scale = _Scale(model)
    limit = 1e3 * max(np.ptp(record.output), 1e-6)

    def residual(x: np.ndarray) -> np.ndarray:
        error = _residual(model.state_space(scale.theta(x), record.sample_time), record)
        return np.clip(np.nan_to_num(error, nan=limit, posinf=limit, neginf=-limit), -limit, limit).ravel()

    box = (0.0, 1.0) if within_bounds else (-np.inf, np.inf)
    from scipy.stats import qmc  # half of the time that importing the package would take

    points = qmc.Sobol(model.size, rng=np.random.default_rng(seed)).random(128)
    points = points[np.argsort([np.sum(residual(x) ** 2) for x in points])[:starts]]
    fits = [least_squares(residual, np.clip(x, 1e-6, 1 - 1e-6), bounds=box, x_scale=0.1, max_nfev=60) for x in points]
    return scale.theta(min(fits, key=lambda fit: fit.cost).x)


def bounds_from_record(model: PredictionModel, record: Record, *, margin: float = 2.0) -> PredictionModel:
    """``model`` with a box made from one short probing record.

    The theta that fits the record is identified without bounds; entries on a log scale may then lie within a factor of
    ``margin`` of theirs, and entries of either sign within ``margin`` times the largest magnitude among the entries of
    their unit.
    """
    if not (np.isfinite(margin) and margin > 1):
        raise ValueError(f"margin is a factor above 1, not {margin}")
    theta = identify(model, record, within_bounds=False)
    largest: dict[str, float] = {}
    for entry, value in zip(model.entries, theta, strict=True):
        if entry.scale == "linear":
            largest[entry.unit] = max(largest.get(entry.unit, 0.0), abs(value))
    bounds = [
        (value / margin, value * margin)
        if entry.scale == "log"
        else (-margin * (largest[entry.unit] or 1e-9), margin * (largest[entry.unit] or 1e-9))
        for entry, value in zip(model.entries, theta, strict=True)
    ]
    return model.with_bounds(bounds)


class _Scale:
    """Between theta and coordinates in which the model's box is the unit cube and log entries are logarithms."""

    def __init__(self, model: PredictionModel) -> None:
        self.log = np.array([entry.scale == "log" for entry in model.entries])
        edges = np.array([(entry.lower, entry.upper) for entry in model.entries])
        edges[self.log] = np.log(edges[self.log])
        self.lower, self.width = edges[:, 0], edges[:, 1] - edges[:, 0]

    def theta(self, x: np.ndarray) -> np.ndarray:
        values = self.lower + x * self.width
        values[self.log] = np.exp(np.clip(values[self.log], -50, 50))
        return values


def _check_fit(model: PredictionModel, record: Record) -> None:
    found = (record.tension.shape[1], record.output.shape[1])
    if found != (model.inputs, model.axes):
        raise ValueError(
            f"the record has {found[0]} tensions and {found[1]} outputs, but the model {model.inputs} and {model.axes}"
        )


def _residual(system: StateSpace, record: Record) -> np.ndarray:
    """Measured minus predicted outputs (N, p) after the first row, the first state fitted."""
    A, B, C, D = system
    samples, order = len(record.tension), len(A)
    # Column 0 is the response to the input from rest, the others the free responses to each first state.
    states = np.zeros((samples + 1, order, 1 + order))
    states[0, :, 1:] = np.eye(order)
    with np.errstate(over="ignore", invalid="ignore"):
        forced = record.tension @ B.T
        for t in range(samples):
            np.matmul(A, states[t], out=states[t + 1])
            states[t + 1, :, 0] += forced[t]
        outputs = C @ states[1:]
    outputs[:, :, 0] += record.tension @ D.T
    # Beyond, squares of the outputs overflow.
    if not np.abs(outputs).max() < 1e150:
        return np.full((samples, len(C)), np.inf)
    free = outputs[:, :, 1:].reshape(-1, order)
    error = (record.output[1:] - outputs[:, :, 0]).ravel()
    first = np.linalg.lstsq(free, error, rcond=1e-10)[0]
    return (error - free @ first).reshape(samples, -1)
