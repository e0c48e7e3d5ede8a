import itertools
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import cho_factor, cho_solve

from ...campaign import Pilot
from ...model import StateSpace, subspace
from ...mpc import Controller, ControllerInfo, weight_matrix
from ..lab import Lab, Method

_BEFORE, _AFTER = 40, 200
"""Samples before and after a change of the reference in which the loop answers to it."""


@dataclass(frozen=True)
class IterativeLearning(Method):
    r"""The same flight again and again, each with the reference shifted by what the errors of those before say.

    Norm-optimal iterative learning control (Bristow, Tharayil, Alleyne, "A survey of iterative learning control", IEEE
    Control Systems Magazine 26(3), 2006) about the study's MPC on the model that N4SID finds in a probing record. The
    shift c (T, p) changes by

    .. math:: \arg\min_\Delta\; |e - T_y \Delta|_Q^2 + |\Delta u + T_u \Delta|_R^2 + j \mu |\Delta|_Q^2,

    where e and :math:`\Delta u` are the errors and changes of inputs of the last flight, the j-th, and T says how the
    loop answers to a shift, by the identified model. What is learned is good for this one task alone.

    Parameters
    ----------
    probing
        s of probing.
    caution
        mu.
    """

    probing: float = 40.0
    caution: float = 10.0

    def offers(self, lab: Lab) -> Iterator[Pilot]:
        study, mpc, model = lab.study, lab.study.mpc, subspace(lab.probe(self.probing))
        controller = mpc.controller_for(model)
        yield controller
        count, p, m = study.task.samples(mpc.sample_time), mpc.outputs, mpc.inputs
        to_y, to_u = _answers(controller, model, count)
        to_change = to_u - np.roll(to_u, m, axis=0)
        to_change[:m] = to_u[:m]
        Q, R = (
            np.kron(np.eye(count), weight_matrix(weight, size, name))
            for weight, size, name in ((study.cost.Q, p, "Q of the cost"), (study.cost.R, m, "R of the cost"))
        )
        curvature = to_y.T @ Q @ to_y + to_change.T @ R @ to_change
        shift, least = np.zeros((count, p)), np.inf
        for run in itertools.count(1):
            pilot = _Shifted(controller, shift)
            episode = lab.fly(pilot)
            if (J := lab.cost(episode)) is None:
                return
            if least > J:
                least = J
                yield pilot
            error = (episode.reference - episode.output)[1:].ravel()
            change = np.diff(np.vstack([episode.held, episode.tension]) / mpc.input_scale, axis=0).ravel()
            # Each step is smaller than the one before, so that the noise of flights averages out.
            normal = cho_factor(curvature + run * self.caution * Q)
            step = cho_solve(normal, to_y.T @ Q @ error - to_change.T @ R @ change)
            shift = shift + step.reshape(count, p)


class _Shifted:
    """A controller whose reference is shifted from sample to sample; a pilot itself."""

    def __init__(self, controller: Controller, shift: np.ndarray) -> None:
        self.mpc, self._controller, self._shift, self._samples = controller.mpc, controller, shift, 0
        self._ahead = np.arange(self.mpc.reference_rows)

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


def _answers(controller: Controller, model: StateSpace, count: int) -> tuple[np.ndarray, np.ndarray]:
    """How outputs (count p) and inputs as shares (count m) answer to a shift (count p), while no bound is active."""
    mpc = controller.mpc
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
