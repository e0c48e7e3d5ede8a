"""Controllers that are no LinearMPC, flown in its place: with its sample time, bounds and preview."""

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ...model import Record
from ...mpc import KKT_TOLERANCE, ActiveSet, ControllerInfo, LinearMPC, weight_matrix
from ...mpc.formulation import dual_program
from ._bounded import leeway


class Law(ABC):
    """A feedback law whose inputs keep the bounds and the rate bounds of an MPC.

    Attributes
    ----------
    mpc
        Says what the inputs may be, how often they change, and how much of the reference is seen ahead.
    info
        What was done since the last reset: ``info.held`` counts the samples in which the law gave no finite input, and
        the last one was held.
    held
        (m,) N, the last input.
    """

    def __init__(self, mpc: LinearMPC) -> None:
        self.mpc, self.info, self.held = mpc, ControllerInfo(), np.zeros(mpc.inputs)

    def reset(self, u_prev: ArrayLike = 0.0) -> None:
        """Forget everything: the robot rests under ``u_prev``, N."""
        self.info = ControllerInfo()
        self.held = np.broadcast_to(np.asarray(u_prev, dtype=float), (self.mpc.inputs,)).copy()
        self.begin()

    def step(self, y: ArrayLike, reference: ArrayLike, disturbance: ArrayLike | None = None) -> np.ndarray:
        """Inputs (m,), N, for the coming sample; y (p,) and reference (P, p) as of :class:`Controller`."""
        wanted = self.act(np.asarray(y, dtype=float), np.atleast_2d(np.asarray(reference, dtype=float)))
        if np.shape(wanted) != (self.mpc.inputs,):
            raise ValueError(
                f"act gave {wanted!r} for the inputs, of shape {np.shape(wanted)}; ({self.mpc.inputs},) is needed"
            )
        self.info.steps += 1
        if not np.isfinite(wanted).all():
            self.info.held += 1
            wanted = self.held
        self.held = np.clip(wanted, *self.allowed)
        return self.held.copy()

    @property
    def allowed(self) -> tuple[np.ndarray, np.ndarray]:
        """Least and largest input (m,), N, that the bounds and the last one allow for the coming sample."""
        return leeway(self.mpc, self.held)

    def prediction_error(self, record: Record) -> float:
        """How far its model, if it has one, is off on a record from rest: root mean square distance, m."""
        predicted = self.predicted(record.tension)
        return float(np.sqrt(np.mean(np.sum((record.output[1:] - predicted) ** 2, axis=1))))

    def predicted(self, tension: np.ndarray) -> np.ndarray:
        """Outputs (T, p), m, at the ends of samples with inputs (T, m), N, from rest; NaN without a model."""
        return np.full((len(tension), self.mpc.outputs), np.nan)

    @abstractmethod
    def begin(self) -> None:
        """Start anew, at rest under ``held``."""

    @abstractmethod
    def act(self, y: np.ndarray, reference: np.ndarray) -> np.ndarray:
        """The input (m,), N, that is wanted now; what is not finite is not applied."""


@dataclass(frozen=True, eq=False)
class Forecast:
    """What the coming N samples hold, affine in what is decided, z (n,), and in what is known now, p (k,).

    Attributes
    ----------
    input
        Au (N m, n) and Bu (N m, k): inputs as shares of u_max, sample after sample, are Au z + Bu p.
    output
        Ay (N p, n) and By (N p, k): outputs, m, are Ay z + By p.
    reference
        (N p, k): what is wanted of them, m, as a map of p.
    before
        (m, k): the last input, as shares of u_max.
    own
        H (n, n) and g (n, k): z'Hz/2 + (g p)'z is added to the cost; None for nothing.
    """

    input: tuple[np.ndarray, np.ndarray]
    output: tuple[np.ndarray, np.ndarray]
    reference: np.ndarray
    before: np.ndarray
    own: tuple[np.ndarray, np.ndarray] | None = None


class Program:
    r"""The program of a predictive controller that has no linear model of its own, or another one:

    .. math:: \min_z\; \sum_{k=1}^{N} |y_k - r_k|_Q^2 + \rho_R(u) + |\Delta u / u_{max}|_{R_\Delta}^2
        + \lambda |s|^2 + \mu |s|_1 + z'Hz/2 + (g p)'z

    within the bounds and rate bounds of an MPC, whose weights these are, R multiplied by ``effort``; bounds of outputs
    are soft. It is solved by the project's own solver in C.
    """

    def __init__(self, mpc: LinearMPC, forecast: Forecast, effort: float = 1.0) -> None:
        (Au, Bu), (Ay, By), m = forecast.input, forecast.output, mpc.inputs
        horizon = len(Au) // m
        each = np.eye(horizon)
        R, Q = effort * weight_matrix(mpc.R, m, "R"), np.kron(each, weight_matrix(mpc.Q, mpc.outputs, "Q"))
        between = np.eye(len(Au)) - np.eye(len(Au), k=-m)
        Am, Bm = between @ Au, between @ Bu  # changes from sample to sample
        Bm[:m] -= forecast.before
        hessian, gradient = 2 * Ay.T @ Q @ Ay, 2 * Ay.T @ Q @ (By - forecast.reference)
        terms = [(R, Am, Bm)] if mpc.input_term == "rate" else [(R, Au, Bu)]
        if mpc.input_term == "literal":
            terms = [(R * np.outer(mpc.input_scale, mpc.input_scale), Au, Bu)]
        if np.any(mpc.rate_weight):
            terms.append((weight_matrix(mpc.rate_weight, m, "rate_weight"), Am, Bm))
        for weight, free_part, known_part in terms:
            weighed = 2 * free_part.T @ np.kron(each, weight)
            hessian, gradient = hessian + weighed @ free_part, gradient + weighed @ known_part
        if forecast.own is not None:
            hessian, gradient = hessian + forecast.own[0], gradient + forecast.own[1]
        rows, free = [Au], [Bu]
        lower, upper = ([np.tile(side / mpc.input_scale, horizon)] for side in mpc.input_limits)
        quadratic, linear = [np.full(len(Au), np.inf)], [np.zeros(len(Au))]
        if mpc.rate_limits is not None:
            rows.append(Am)
            free.append(Bm)
            for sides, side in zip((lower, upper), mpc.rate_limits, strict=True):
                sides.append(np.tile(side * mpc.sample_time / mpc.input_scale, horizon))
            quadratic.append(np.full(len(Am), np.inf))
            linear.append(np.zeros(len(Am)))
        if mpc.output_limits is not None:
            unit = mpc.largest_output_bound
            rows.append(Ay / unit)
            free.append(By / unit)
            lower.append(np.tile(mpc.output_limits[0] / unit, horizon))
            upper.append(np.tile(mpc.output_limits[1] / unit, horizon))
            for prices, price in ((quadratic, 2 * np.asarray(mpc.slack_weight) * unit), (linear, mpc.slack_linear)):
                prices.append(np.tile(np.broadcast_to(np.asarray(price) * unit, mpc.outputs), horizon))
        stacked = (*map(np.vstack, (rows, free)), *map(np.concatenate, (lower, upper, quadratic, linear)))
        self._scale, self._shape = mpc.input_scale, (horizon, m)
        self._solver = ActiveSet(dual_program(hessian, gradient, *stacked))

    def forget(self) -> None:
        """Start the next solution from nothing."""
        self._solver.forget()

    def inputs(self, parameters: np.ndarray, info: ControllerInfo) -> np.ndarray:
        """The coming inputs (N, m), N; NaN where the solver has no answer. ``info`` is told of the solver."""
        answer = self._solver.solve(parameters)
        info.iterations, info.residual = answer.iterations, answer.residual
        if not answer.residual <= KKT_TOLERANCE:
            return np.full(self._shape, np.nan)
        return answer.values[: self._shape[0] * self._shape[1]].reshape(self._shape) * self._scale


def looked_ahead(reference: np.ndarray, rows: int) -> np.ndarray:
    """So many rows of the reference (rows, p), the last one held."""
    return reference[np.minimum(np.arange(rows), len(reference) - 1)]
