"""What the exported C is compared with, and whether single precision is good enough for a controller."""

import dataclasses
from dataclasses import dataclass

import numpy as np

from ..codegen import c_compiler
from ..mpc import Controller
from ._errors import ExportError
from ._record import ControllerRecord

FLOAT_SHARE = 1e-3
"""Largest difference between single and double precision that is accepted, as a share of an input's bound."""

_RANDOM_SAMPLES = 2000


@dataclass(frozen=True, eq=False)
class Vectors:
    """What the exported C is replayed on: the recorded episode, and random samples behind it.

    Attributes
    ----------
    start, held
        Samples before which the controller starts anew, and the tensions (starts, m) under which the robot rests then.
    output, reference, disturbance
        (samples, ...) arguments of a step, the preview row after row.
    input
        (samples, m) what Python answers in double precision.
    fallbacks
        Samples in which that is not the QP's answer.
    """

    start: list[int]
    held: np.ndarray
    output: np.ndarray
    reference: np.ndarray
    disturbance: np.ndarray
    input: np.ndarray
    fallbacks: int


def vectors(record: ControllerRecord, random: int) -> Vectors:
    """The episode of ``record`` and as many random samples."""
    controller = dataclasses.replace(record.mpc, backend="active-set").controller_for(record.system)
    episode = [(record.held if t == 0 else None, sample) for t, sample in enumerate(record.samples())]
    start, held, given, answers, fallbacks = [], [], [], [], 0
    for t, (resting, sample) in enumerate([*episode, *record.random_samples(random)]):
        if resting is not None:
            start.append(t)
            held.append(resting)
            controller.reset(resting)
        given.append(sample)
        answers.append(controller.step(*sample))
        fallbacks += controller.info.status != 0
    output, preview, disturbance = (np.array(values) for values in zip(*given, strict=True))
    return Vectors(
        start, np.array(held), output, preview.reshape(len(given), -1), disturbance, np.array(answers), fallbacks
    )


def check_single_precision(record: ControllerRecord) -> float:
    """Compare float with double on the recorded episode and on random samples, and return the largest difference.

    Returns
    -------
    float
        As a share of the input bound.

    Raises
    ------
    ExportError
        An input differs by more than FLOAT_SHARE of its bound, single precision falls back where double does not, or
        there is no C compiler to find out.
    """
    if c_compiler() is None:
        raise ExportError("real='float' is accepted by test only, and there is no C compiler to test it with")
    mpc = dataclasses.replace(record.mpc, backend="active-set")
    pair = [mpc.controller_for(record.system, real=real) for real in ("double", "float")]
    worst = 0.0
    for controller in pair:
        controller.reset(record.held)
    for t, sample in enumerate(record.samples()):
        worst = max(worst, _difference(pair, sample, f"sample {t} of the episode"))
    for i, (held, sample) in enumerate(record.random_samples(_RANDOM_SAMPLES)):
        if held is not None:
            for controller in pair:
                controller.reset(held)
        worst = max(worst, _difference(pair, sample, f"random sample {i}"))
    return worst


def _difference(pair: list[Controller], sample: tuple[np.ndarray, ...], where: str) -> float:
    double, single = pair
    exact, rounded = (controller.step(*sample) for controller in pair)
    if single.info.status > double.info.status:
        raise ExportError(
            f"single precision does not do for this controller: at {where} its QP is solved only to a residual of "
            f"{single.info.residual:.0e}; export it with real='double'"
        )
    share = float(np.max(np.abs(rounded - exact) / double.mpc.input_scale))
    if not share <= FLOAT_SHARE:
        raise ExportError(
            f"single precision does not do for this controller: at {where} an input differs from double precision by "
            f"{share:.1e} of its bound, and {FLOAT_SHARE:g} is allowed; export it with real='double'"
        )
    return share
