"""Can a prediction model of this family, within the bounds of theta, stand for the robot."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..campaign import Study
from ..model import Record, identify, prediction_error
from ._case import Case, percent
from ._finding import Finding
from ._robot import Pose

_FITS, _FAILS = 0.2, 0.5
"""Open-loop error as a share of the response: ``ok`` below the first, ``infeasible`` above the second."""
_BETTER = 0.7
"""An error outside the bounds that is below so much of that within: the bounds are in the way."""
_EDGE = 0.01
ON_RECORD = "on the record"
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


@dataclass(frozen=True, eq=False)
class Mistake:
    """What may be wrong with a record: its name, what to do, and the record as it would be without it."""

    name: str
    advice: str
    record: Record


def fits(case: Case) -> list[Fit]:
    """The best theta for the probing record; without one for the robot at rest, and at the far end of the reference."""
    if case.record is not None:
        records = {ON_RECORD: case.record}
    else:
        records = {"at rest": _response(case, case.rest), "farthest from there": _response(case, case.far)}
    return [fit(case.study, where, record) for where, record in records.items()]


def family(study: Study, found: list[Fit], mistakes: Sequence[Mistake] = ()) -> list[Finding]:
    """Is there a theta within the bounds that moves as the robot does? If not, which mistake would explain it?"""
    worst, model = max(fit.share for fit in found), study.mpc.model
    told = ", ".join(f"{percent(fit.share)} {fit.where}" for fit in found)
    says = f"the best {type(model).__name__} within theta's bounds errs by {told}, as a share of the response"
    verdict = "infeasible" if worst > _FAILS else "doubtful" if worst > _FITS else "ok"
    if worst > _FITS:
        explained: tuple[Mistake, float] | None = None
        for mistake in mistakes:
            share = fit(study, mistake.name, mistake.record).share
            if explained is not None and share >= explained[1]:
                break  # the likeliest that explains it is told, but for one that is akin and explains it better
            if share < min(_FITS, worst / 2):
                explained = mistake, share
        if explained is not None:
            says = f"{says}; with {explained[0].name} by {percent(explained[1])}"
            return [Finding("model", verdict, says, explained[0].advice)]
    outside: set[str] = set()
    for within in found:
        if within.share > _FITS / 2:
            free = fit(study, within.where, within.record, within_bounds=False)
            if free.share < _BETTER * within.share:
                outside |= _outside(study, free.theta)
    if outside:
        listed = [entry for entry in model.entries if entry.name in outside]
        says, advice = f"{says}; a better one lies outside", f"wider bounds of {', '.join(e.name for e in listed)}"
        if all(entry.scale == "linear" for entry in listed):
            advice = f"the sign, order and unit of inputs and outputs; if they are right, {advice}"
        return [Finding("model", "doubtful" if verdict == "ok" else verdict, says, advice)]
    return [Finding("model", verdict, says, "" if verdict == "ok" else "a family of a higher order")]


def fit(study: Study, where: str, record: Record, within_bounds: bool = True) -> Fit:
    """The theta of the family that moves most like the robot in a record."""
    model, moved = study.mpc.model, record.output[1:] - record.output[0]
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


def _outside(study: Study, theta: np.ndarray) -> set[str]:
    names = set()
    for entry, value in zip(study.mpc.model.entries, theta, strict=True):
        margin = _EDGE * (entry.upper - entry.lower)
        if not entry.lower - margin <= value <= entry.upper + margin:
            names.add(entry.name)
    return names
