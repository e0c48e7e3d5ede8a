"""With the model that fits best: is the loop stable, what error is left, do solver and single precision do."""

from dataclasses import replace

import numpy as np

from ..codegen import c_compiler
from ..export import ControllerRecord, ExportError, check_single_precision
from ..mpc import Controller, DesignError
from ._case import Case
from ._finding import Finding

_LARGE = 0.2
"""Settled error as a share of what the task asks for, from which on it is doubtful."""
_SAMPLES, _FALLBACKS = 500, 0.02
"""Random samples that the solver is given, and the share of them that may fail its check."""


def arithmetic(case: Case, theta: np.ndarray) -> list[Finding]:
    """Of the controller on the model of ``theta``: its loop around the robot, its solver, its single precision."""
    mpc = replace(case.study.mpc, tuned=())
    try:
        controller = mpc.controller(theta)
        record = ControllerRecord.simulated(mpc, mpc.system(theta))
    except DesignError as error:
        says = f"the model that fits the robot best gives none: {error}"
        return [Finding("controller", "infeasible", says, "another family, or other weights")]
    loop = _loop(case, controller)
    if loop.verdict != "ok":
        return [loop]
    settled = [] if case.noise is None or not case.asked else [_settled(case, controller)]
    return [loop, *settled, *_precision(controller, record)]


def _loop(case: Case, controller: Controller) -> Finding:
    loop = controller.analysis(case.linear)
    says = f"with the model that fits best its spectral radius is {loop.spectral_radius:.3f}"
    if not loop.stable:
        advice = (
            "a family that fits better, a larger R, terminal='riccati', or units in which the inputs are of like size"
        )
        return Finding("loop", "doubtful", f"{says}: unstable; the search has to find another", advice)
    return Finding("loop", "ok", f"{says}; stable up to {loop.gain_margin[1]:.2g} times the robot's gain")


def _settled(case: Case, controller: Controller) -> Finding:
    noise = case.noise or 0.0
    loud, quiet = (_settled_error(case, controller, level) for level in (noise, 0.0))
    says = f"about {case.length(loud)} RMSE after the start, {case.length(quiet)} of it without noise"
    if loud <= _LARGE * case.asked:
        return Finding("settled error", "ok", says)
    cause = "a better sensor, or a lower measurement_noise in the MPC" if quiet < loud / 2 else "other weights"
    return Finding("settled error", "doubtful", f"{says}; the task asks for {case.length(case.asked)}", cause)


def _settled_error(case: Case, controller: Controller, noise: float) -> float:
    """Root mean square distance from the reference once settled, flown on the robot's linear model about rest."""
    mpc, rest, random = case.study.mpc, case.rest, np.random.default_rng(0)
    A, B, C, D = case.linear
    u = case.begun.input - rest.input
    x = np.linalg.lstsq(np.eye(len(A)) - A, B @ u, rcond=None)[0]
    y, distances, ahead = case.begun.output, [], np.arange(1, mpc.reference_rows + 1)
    controller.reset(case.begun.input)
    for t, wanted in enumerate(case.reference[1:]):
        measured = y + noise * random.standard_normal(len(y))
        u = controller.step(measured, case.study.task.reference((t + ahead) * mpc.sample_time)) - rest.input
        x = A @ x + B @ u
        y = rest.output + C @ x + D @ u
        distances.append(np.linalg.norm(y - wanted))
    return float(np.sqrt(np.mean(np.square(distances)[case.settled])))


def _precision(controller: Controller, record: ControllerRecord) -> list[Finding]:
    fallen = 0
    for held, sample in record.random_samples(_SAMPLES):
        if held is not None:
            controller.reset(held)
        controller.step(*sample)
        fallen += controller.info.status != 0
    mpc = controller.mpc
    told = f"slack_weight / R is {np.max(mpc.slack_weight) / np.max(np.asarray(mpc.R, dtype=float)):.0e}"
    if fallen > _FALLBACKS * _SAMPLES:
        says = f"{told}: in {fallen} of {_SAMPLES} random samples the QP's answer does not pass its check"
        return [Finding("solver", "infeasible", says, "weights that lie fewer decades apart")]
    if c_compiler() is None:
        says = f"{told}; whether float does is not known without a C compiler"
        return [Finding("single precision", "unknown", says, "install gcc")]
    try:
        share = check_single_precision(record)
    except ExportError as error:
        advice = "slack_weight / R of 1e6 or less, or real='double' (Cortex-M7)"
        return [Finding("single precision", "doubtful", f"{told}: {error}", advice)]
    return [Finding("single precision", "ok", f"{told}; float answers within {share:.0e} of the input bound")]
