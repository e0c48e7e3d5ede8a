"""Is the loop stable with the model that fits best, and do solver and single precision do for the weights."""

import numpy as np

from ..codegen import c_compiler
from ..export import ControllerRecord, ExportError, check_single_precision
from ..mpc import Controller, DesignError
from ._case import Case
from ._finding import Finding

_SAMPLES, _FALLBACKS = 500, 0.02
"""Random samples that the solver is given, and the share of them that may fail its check."""


def arithmetic(case: Case, theta: np.ndarray) -> list[Finding]:
    """Of the controller on the model of ``theta``: its loop around the robot, its solver, its single precision."""
    mpc = case.study.mpc
    try:
        controller = mpc.controller(theta)
        record = ControllerRecord.simulated(mpc, mpc.model.state_space(theta, mpc.sample_time))
    except DesignError as error:
        says = f"the model that fits the robot best gives none: {error}"
        return [Finding("controller", "infeasible", says, "another family, or other weights")]
    return [_loop(case, controller), *_precision(controller, record)]


def _loop(case: Case, controller: Controller) -> Finding:
    loop = controller.analysis(case.linear)
    says = f"with the model that fits best its spectral radius is {loop.spectral_radius:.3f}"
    if not loop.stable:
        return Finding("loop", "infeasible", f"{says}: unstable", "a larger R, or terminal='riccati'")
    return Finding("loop", "ok", f"{says}; stable up to {loop.gain_margin[1]:.2g} times the robot's gain")


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
