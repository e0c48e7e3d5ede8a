from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import cho_factor, cho_solve

from ...campaign import Pilot, Study
from ...model import Record, StateSpace, state_space_error
from ...mpc import Controller, ControllerInfo, weight_matrix
from ..lab import Lab, Method, believed, check_count, check_least
from ._weights import WeightSearch

_BEFORE, _AFTER = 40, 200
"""Samples before and after a change of the reference in which the loop answers to it."""


@dataclass(frozen=True)
class IterativeLearning(Method):
    r"""The same flight again and again, with the reference shifted by what the errors of those before say.

    Norm-optimal iterative learning control (Bristow, Tharayil, Alleyne, "A survey of iterative learning control", IEEE
    Control Systems Magazine 26(3), 2006) about a tuned MPC. The shift c (T, p) changes by

    .. math:: \arg\min_\Delta\; |e - T_y \Delta|_Q^2 + |w + T_w \Delta|_R^2 + \mu |\Delta|_Q^2,

    where e and w are errors and what the cost's R weighs of the inputs, means over some flights with the best shift so
    far, and T says how the loop answers to a shift, by the MPC's model. Where that does not lower the mean J, mu is
    made larger and the step shorter. What is learned is good for this one task alone.

    Parameters
    ----------
    base
        Where the MPC comes from; nothing is learned before it is through.
    flights
        With each shift.
    caution
        mu at first.
    """

    base: Method = field(default_factory=lambda: WeightSearch(flights=3, most=30))
    flights: int = 3
    caution: float = 3.0

    def __post_init__(self) -> None:
        super().__post_init__()
        check_count(1, flights=self.flights)
        check_least(0, caution=self.caution)

    def offers(self, lab: Lab) -> Iterator[Pilot]:
        controller = None
        for controller in self.base.offers(lab):
            yield controller
        if not isinstance(controller, Controller):
            return
        study, mpc = lab.study, controller.mpc
        count, p, m = study.task.samples(mpc.sample_time), mpc.outputs, mpc.inputs
        to_y, to_u = _answers(controller, count)
        scale = mpc.input_scale[:, None]
        to_weighed = _weighed(study, np.zeros((m, count * p)), to_u.reshape(count, m, count * p))
        Q, R = (
            np.kron(np.eye(count), weight_matrix(weight, size, name))
            for weight, size, name in ((study.cost.Q, p, "Q of the cost"), (study.cost.R, m, "R of the cost"))
        )
        curvature = to_y.T @ Q @ to_y + to_weighed.T @ R @ to_weighed
        caution, least, best, downhill = self.caution, np.inf, np.zeros((count, p)), np.zeros(count * p)
        shift = best
        while True:
            pilot = _Shifted(controller, shift)
            episodes = [lab.fly(pilot) for _ in range(self.flights)]
            costs = [np.inf if (J := lab.cost(episode)) is None else J for episode in episodes]
            if (J := np.mean(costs)) < least:
                least, best = J, shift
                yield pilot
                errors = [(episode.reference - episode.output)[1:].ravel() for episode in episodes]
                held, used = (np.mean([getattr(e, n) for e in episodes], axis=0) for n in ("held", "tension"))
                weighed = _weighed(study, held[:, None] / scale, used[:, :, None] / scale)[:, 0]
                downhill = to_y.T @ Q @ np.mean(errors, axis=0) - to_weighed.T @ R @ weighed
            elif least == np.inf:
                return
            else:
                caution *= 3
            shift = best + cho_solve(cho_factor(curvature + caution * Q), downhill).reshape(count, p)


class _Shifted:
    """A controller whose reference is shifted from sample to sample; a pilot itself."""

    def __init__(self, controller: Controller, shift: np.ndarray) -> None:
        self.mpc, self._controller, self._shift, self._samples = controller.mpc, controller, shift, 0
        self._ahead = np.arange(self.mpc.reference_rows)

    def prediction_error(self, record: Record) -> float:
        return state_space_error(believed(self._controller), record)

    @property
    def info(self) -> ControllerInfo:
        return self._controller.info

    def reset(self, u_prev: ArrayLike = 0.0) -> None:
        self._controller.reset(u_prev)
        self._samples = 0

    def step(self, y: ArrayLike, reference: ArrayLike, disturbance: ArrayLike | None = None) -> np.ndarray:
        # Row 0 of the shift belongs to the first sample, as row 0 of a preview does.
        rows = np.minimum(self._samples + self._ahead, len(self._shift) - 1)
        self._samples += 1
        return self._controller.step(y, np.atleast_2d(reference) + self._shift[rows], disturbance)


def _weighed(study: Study, held: np.ndarray, inputs: np.ndarray) -> np.ndarray:
    """What the cost's R weighs (T m, K) of inputs (T, m, K), shares of u_max, the last before them ``held`` (m, K)."""
    match study.cost.input_term:
        case "rate":
            inputs = np.diff(inputs, axis=0, prepend=held[None])
        case "literal":
            inputs = inputs * study.mpc.input_scale[:, None]
    return inputs.reshape(-1, inputs.shape[2])


def _answers(controller: Controller, count: int) -> tuple[np.ndarray, np.ndarray]:
    """How outputs (count p) and inputs as shares (count m) answer to a shift (count p), while no bound is active."""
    mpc, model = controller.mpc, believed(controller)
    p, m, size = mpc.outputs, mpc.inputs, 1e-3 * min(mpc.largest_output_bound, 1.0)
    to_y, to_u = np.zeros((count, p, count, p)), np.zeros((count, m, count, p))
    for i in range(p):
        shift = np.zeros((_BEFORE + _AFTER, p))
        shift[_BEFORE, i] = size
        y, u = (answer / size for answer in _flown(_Shifted(controller, shift), model, len(shift)))
        for k in range(count):
            # The loop looks ahead, so that it answers before the shift comes.
            rows = np.arange(max(k - _BEFORE, 0), min(k + _AFTER, count))
            to_y[rows, :, k, i] = y[rows - k + _BEFORE]
            to_u[rows, :, k, i] = u[rows - k + _BEFORE] / mpc.input_scale
    return to_y.reshape(count * p, count * p), to_u.reshape(count * m, count * p)


def _flown(pilot: _Shifted, model: StateSpace, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Outputs (count, p) and inputs (count, m) of a flight on a linear model from rest, the reference zero."""
    A, B, C, D = model
    x, y, outputs, inputs = np.zeros(len(A)), np.zeros(len(C)), [], []
    pilot.reset()
    for _ in range(count):
        u = pilot.step(y, np.zeros((pilot.mpc.reference_rows, len(C))))
        x = A @ x + B @ u
        y = C @ x + D @ u
        outputs.append(y)
        inputs.append(u)
    return np.array(outputs), np.array(inputs)
