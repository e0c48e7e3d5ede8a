"""Can a prediction model of this family, within the bounds of theta, stand for the robot."""

from dataclasses import dataclass

import numpy as np

from ..model import Record, identify, prediction_error
from ._case import Case, percent
from ._finding import Finding
from ._robot import Pose

_FITS, _FAILS = 0.2, 0.5
"""Open-loop error as a share of the response: ``ok`` below the first, ``infeasible`` above the second."""
_BETTER = 0.7
"""An error outside the bounds that is below so much of that within: the bounds are in the way."""
_EDGE = 0.01
_STEPS, _HOLD, _PART = 30, 0.4, 0.3
"""Steps of a simulated probing record, how long each lasts, s, and the share of the input bound that they use."""


@dataclass(frozen=True, eq=False)
class Fit:
    """The theta within the bounds that moves most like the robot somewhere."""

    where: str
    record: Record
    theta: np.ndarray
    share: float
    """Its open-loop error as a share of the robot's response, root mean squares."""


def fits(case: Case) -> list[Fit]:
    """The best theta for the probing record; without one for the robot at rest, and at the far end of the reference."""
    if case.record is not None:
        records = {"on the record": case.record}
    else:
        records = {"at rest": _response(case, case.rest), "farthest from there": _response(case, case.far)}
    return [_fit(case, where, record) for where, record in records.items()]


def family(case: Case, found: list[Fit]) -> list[Finding]:
    """Is there a theta within the bounds that moves as the robot does?"""
    worst, model = max(fit.share for fit in found), case.study.mpc.model
    told = ", ".join(f"{percent(fit.share)} {fit.where}" for fit in found)
    says = f"the best {type(model).__name__} within theta's bounds errs by {told}, as a share of the response"
    verdict = "infeasible" if worst > _FAILS else "doubtful" if worst > _FITS else "ok"
    outside: set[str] = set()
    for fit in found:
        if fit.share > _FITS / 2:
            free = _fit(case, fit.where, fit.record, within_bounds=False)
            if free.share < _BETTER * fit.share:
                outside |= _outside(case, free.theta)
    if outside:
        listed = [entry for entry in model.entries if entry.name in outside]
        says, advice = f"{says}; a better one lies outside", f"wider bounds of {', '.join(e.name for e in listed)}"
        if all(entry.scale == "linear" for entry in listed):
            advice = f"the sign, order and unit of inputs and outputs; if they are right, {advice}"
        return [Finding("model", "doubtful" if verdict == "ok" else verdict, says, advice)]
    return [Finding("model", verdict, says, "" if verdict == "ok" else "a family of a higher order")]


def _fit(case: Case, where: str, record: Record, within_bounds: bool = True) -> Fit:
    model, moved = case.study.mpc.model, record.output[1:] - record.output[0]
    theta = identify(model, record, starts=2, within_bounds=within_bounds)
    size = float(np.sqrt(np.mean(np.sum(moved**2, axis=1))))
    return Fit(where, record, theta, prediction_error(model, theta, record) / max(size, 1e-12))


def _response(case: Case, pose: Pose) -> Record:
    """How the robot's linear model about a pose answers to random steps of all inputs, without noise."""
    mpc = case.study.mpc
    A, B, C, D = case.robot.linear(pose)
    held = max(round(_HOLD / mpc.sample_time), 1)
    steps = np.random.default_rng(0).uniform(-_PART, _PART, (_STEPS, len(mpc.input_scale)))
    given = np.repeat(steps * mpc.input_scale, held, axis=0)
    x, output = np.zeros(len(A)), [np.zeros(len(C))]
    for u in given:
        x = A @ x + B @ u
        output.append(C @ x + D @ u)
    return Record(mpc.sample_time, given, np.array(output))


def _outside(case: Case, theta: np.ndarray) -> set[str]:
    names = set()
    for entry, value in zip(case.study.mpc.model.entries, theta, strict=True):
        margin = _EDGE * (entry.upper - entry.lower)
        if not entry.lower - margin <= value <= entry.upper + margin:
            names.add(entry.name)
    return names
