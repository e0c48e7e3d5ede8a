from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import count as count_from
from itertools import product

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import cho_factor, cho_solve

from ...campaign import Pilot, Study
from ...model import Record, StateSpace, state_space_error
from ...mpc import Controller, ControllerInfo, weight_matrix
from ..lab import Lab, Method, believed, check_least
from ._weights import WeightSearch

_AFTER = 200
"""Samples after a change of the reference in which inputs answer to it."""


@dataclass(frozen=True)
class IterativeLearning(Method):
    r"""The same flight again and again, with the reference shifted by what the errors of those before say.

    Norm-optimal iterative learning control (Bristow, Tharayil, Alleyne, "A survey of iterative learning control", IEEE
    Control Systems Magazine 26(3), 2006) about a tuned MPC. After flight k the shift c (T, p) changes by

    .. math:: \arg\min_\Delta\; |e - T_y \Delta|_Q^2 + |w + T_w \Delta|_R^2 + k \mu |\Delta|_Q^2,

    where e is the flight's error, w what the cost's R weighs of its inputs, and T says how the loop answers to a shift,
    by the MPC's model. Steps that shorten with k average the sensor's noise out (Saab, "A discrete-time stochastic
    learning control algorithm", IEEE Trans. Automatic Control 46(6), 2001). What is learned is good for this one task
    alone.

    Parameters
    ----------
    base
        Where the MPC comes from; nothing is learned before it is through.
    caution
        mu.
    """

    base: Method = field(default_factory=lambda: WeightSearch(flights=3, most=30))
    caution: float = 1.0

    def __post_init__(self) -> None:
        super().__post_init__()
        check_least(0, caution=self.caution)

    def offers(self, lab: Lab) -> Iterator[Pilot]:
        controller = None
        for controller in self.base.offers(lab):
            yield controller
        if not isinstance(controller, Controller):
            return
        study, mpc, model = lab.study, controller.mpc, believed(controller)
        count, p, m = study.task.samples(mpc.sample_time), mpc.outputs, mpc.inputs
        scale, to_u = mpc.input_scale, _answers(controller, model, count)
        to_y = _responses(model, count) @ to_u
        of_shift = _weighed(study, np.zeros(m), to_u.reshape(count, m, -1) / scale[:, None])
        Q, R = (
            np.kron(np.eye(count), weight_matrix(weight, size, name))
            for weight, size, name in ((study.cost.Q, p, "Q of the cost"), (study.cost.R, m, "R of the cost"))
        )
        curvature, shift = to_y.T @ Q @ to_y + of_shift.T @ R @ of_shift, np.zeros(count * p)
        for k in count_from(1):
            pilot = _Shifted(controller, shift.reshape(count, p))
            flown = lab.fly(pilot)
            if lab.cost(flown) is None:
                return
            yield pilot
            of_flight = _weighed(study, flown.held / scale, flown.tension[:, :, None] / scale[:, None])[:, 0]
            downhill = to_y.T @ Q @ (flown.reference - flown.output)[1:].ravel() - of_shift.T @ R @ of_flight
            shift = shift + cho_solve(cho_factor(curvature + k * self.caution * Q), downhill)


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
    """What the cost's R weighs (T m, K) of inputs (T, m, K), shares of u_max, the last before them ``held`` (m,)."""
    match study.cost.input_term:
        case "rate":
            before = np.broadcast_to(held[:, None], inputs.shape[1:])
            inputs = np.diff(inputs, axis=0, prepend=before[None])
        case "literal":
            inputs = inputs * study.mpc.input_scale[:, None]
    return inputs.reshape(-1, inputs.shape[2])


def _answers(controller: Controller, model: StateSpace, count: int) -> np.ndarray:
    """How inputs (count m), N, answer to a shift (count p) in the loop with the model, while no bound is active."""
    (A, B, C, D), mpc = model, controller.mpc
    p, m, size = mpc.outputs, mpc.inputs, 1e-3 * min(mpc.largest_output_bound, 1.0)
    # The loop looks ahead, so that it answers before a shift comes; the last one is held for as long as it looks.
    to_u, ahead = np.zeros((count, m, count, p)), mpc.reference_rows
    for i, last in product(range(p), (False, True)):
        shift, u = np.zeros((ahead + _AFTER, p)), np.zeros((ahead + _AFTER, m))
        shift[ahead : None if last else ahead + 1, i] = size
        pilot, x, y = _Shifted(controller, shift), np.zeros(len(A)), np.zeros(p)
        pilot.reset()
        for k in range(len(shift)):
            u[k] = pilot.step(y, np.zeros((mpc.reference_rows, p)))
            x = A @ x + B @ u[k]
            y = C @ x + D @ u[k]
        for k in [count - 1] if last else range(count - 1):
            rows = np.arange(max(k - ahead, 0), min(k + _AFTER, count))
            to_u[rows, :, k, i] = u[rows - k + ahead] / size
    return to_u.reshape(count * m, count * p)


def _responses(model: StateSpace, count: int) -> np.ndarray:
    """How a linear model's outputs (count p) at the ends of samples depend on the inputs (count m) in them."""
    (A, after, C, D), responses = model, []
    (p, m), whole = D.shape, np.zeros((count, len(D), count, D.shape[1]))
    for _ in range(count):
        responses.append(C @ after)
        after = A @ after
    responses[0] = responses[0] + D
    for k in range(count):
        whole[k:, :, k] = responses[: count - k]
    return whole.reshape(count * p, count * m)
