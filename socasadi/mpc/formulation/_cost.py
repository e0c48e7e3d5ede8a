"""The cost as a quadratic function of the moves and the parameters."""

from typing import NamedTuple

import casadi as ca

from ._augment import System, queued
from ._condense import Prediction
from ._parameters import Parameters
from ._riccati import riccati, riccati_residual
from ._target import Rest

_IDLE = 1e-4


class StageCost(NamedTuple):
    r"""Weights of one sample: :math:`|y - r|_Q^2 + |v|^2_{input} + |v - v_c|^2_{idle} + |\Delta v|^2_{change}`."""

    Q: ca.MX
    input: ca.MX
    idle: ca.MX
    change: ca.MX
    middle: ca.DM
    """v_c (m,), in the middle of the bounds."""


def idle_weight(R: ca.MX, slope: ca.MX, gain: ca.MX) -> ca.MX:
    r"""Weight that holds what the outputs at rest do not see: :math:`10^{-4} P R P`, :math:`P = I - T G`.

    T is the slope of the steady target, so that P projects on the null space of the static gain G as far as Q sees it
    (all three cables pulled alike, say). A weight on changes leaves the input free to drift there, and an error of the
    model makes it drift. The steady target lies nearest to the middle of the bounds, where this weight is zero, so that
    it moves no steady state.
    """
    P = ca.MX.eye(gain.shape[1]) - slope @ gain
    return _IDLE * P.T @ R @ P


class Target(NamedTuple):
    """The steady state of least stage cost, as maps (., parameters)."""

    input: ca.MX
    state: ca.MX
    miss: ca.MX
    """(p, .) its outputs less the reference."""


def steady_state(parameters: Parameters, rest: Rest, start: ca.MX, slope: ca.MX) -> Target:
    """Where ``v = start + slope (r - d)`` leads, for the last reference and under the disturbances d and w."""
    k, p = rest.state_w.shape[1], rest.output_v.shape[0]
    d = parameters.map(p, x=ca.horzcat(ca.MX(p, parameters.state - p), ca.MX.eye(p)))
    r = parameters.map(p, r=ca.horzcat(ca.MX(p, parameters.reference - p), ca.MX.eye(p)))
    w = parameters.map(k, w=ca.MX.eye(k))
    wanted = r - rest.output_d @ d - rest.output_w @ w
    v = slope @ wanted + parameters.map(slope.shape[0], one=start)
    return Target(v, rest.state_v @ v + rest.state_w @ w + rest.state_d @ d, rest.output_v @ v - wanted)


class CostToGo(NamedTuple):
    """Cost beyond the horizon, of the :func:`queued` state's deviation s from the steady target: s'Ps + 2 miss' L s."""

    weight: ca.MX
    slope: ca.MX
    """L (p, order); where the target misses the reference, as a weight on the input makes it, the cost has a slope."""
    residual: ca.MX
    """Relative residual of the Riccati equation."""


def cost_to_go(system: System, delay: int, stage: StageCost) -> CostToGo:
    """Of the unconstrained problem without end. The last output of the horizon is paid for there and is left out."""
    n, m = system.B.shape
    A, B, _, C, _, _ = queued(system, delay)
    order = A.shape[0]
    before = ca.horzcat(ca.MX(m, n), ca.MX.eye(m), ca.MX(m, order - n - m))
    outputs = C.T @ stage.Q @ C
    equation = (
        A,
        B,
        outputs + before.T @ stage.change @ before,
        stage.input + stage.idle + stage.change,
        -before.T @ stage.change,
    )
    P = riccati(*equation)
    # Inputs to come add nothing to the slope, since the target is optimal: only what the state brings about by itself.
    slope = stage.Q @ C @ ca.solve(ca.MX.eye(order) - A, A)
    return CostToGo(P - outputs, slope, riccati_residual(P, *equation))


class Term(NamedTuple):
    """Of the cost: |forced z + free p|^2 with a weight."""

    forced: ca.MX | ca.DM
    free: ca.MX
    weight: ca.MX


def horizon_terms(
    stage: StageCost, parameters: Parameters, prediction: Prediction, hold: ca.DM, difference: ca.DM, preview: ca.DM
) -> list[Term]:
    """The sum over the horizon. ``prediction`` starts from (x, w); the other three map moves and reference rows."""
    (samples, _), m = hold.shape, stage.middle.shape[0]
    horizon = samples // m
    first = ca.vertcat(ca.MX.eye(m), ca.MX(samples - m, m))

    def every(weight: ca.MX) -> ca.MX:
        return ca.kron(ca.MX.eye(horizon), weight)

    known, rows = parameters.known(prediction.output_free), preview.shape[0]
    return [
        Term(prediction.output_forced @ hold, parameters.map(rows, **known, r=-preview), every(stage.Q)),
        Term(difference @ hold, parameters.map(samples, v=-first), every(stage.change)),
        Term(hold, parameters.map(samples), every(stage.input)),
        Term(hold, parameters.map(samples, one=-ca.repmat(stage.middle, horizon, 1)), every(stage.idle)),
    ]


def last_deviation(
    parameters: Parameters, prediction: Prediction, hold: ca.DM, target: Target, delay: int
) -> tuple[ca.MX, ca.MX]:
    """The :func:`queued` state after the last sample of the horizon less its target, forced and free."""
    m, n = target.input.shape[0], target.state.shape[0]
    order = n + (delay + 1) * m
    wanted = ca.vertcat(target.state, ca.repmat(target.input, delay + 1, 1))
    if delay:  # the queue is part of the observer's state
        known = parameters.known(prediction.last_free[:order, :])
        return prediction.last_forced[:order, :] @ hold, parameters.map(order, **known) - wanted
    known = parameters.known(prediction.last_free[:n, :])
    forced = ca.vertcat(prediction.last_forced[:n, :] @ hold, hold[-m:, :])
    return forced, ca.vertcat(parameters.map(n, **known), parameters.map(m)) - wanted
