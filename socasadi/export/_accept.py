"""What the exported C is compared with, and whether single precision is good enough for a controller."""

import dataclasses
from collections.abc import Callable

import numpy as np

from ..codegen import c_compiler
from ..mpc import Controller
from ._errors import ExportError
from ._record import ControllerRecord

FLOAT_SHARE = 1e-3
"""Largest difference between single and double precision that is accepted, as a share of an input's bound."""

_RANDOM_SAMPLES = 500


def expected_inputs(record: ControllerRecord) -> np.ndarray:
    """What the controller answers to the recorded episode in Python, in double precision, (T, m)."""
    controller = dataclasses.replace(record.mpc, backend="active-set").controller_for(record.system)
    controller.reset(record.held)
    return np.array([controller.step(*sample) for sample in record.samples()])


def check_single_precision(record: ControllerRecord) -> float:
    """Compare float with double on the recorded episode and on random states, and return the largest difference.

    Each of the random samples starts from rest under random inputs, and has a random measurement, reference and
    measured disturbance, as large as the bounds allow or as they are in the episode, whichever is more.

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
        worst = max(worst, _difference(pair, lambda c, s=sample: c.step(*s), f"sample {t} of the episode"))
    rng = np.random.default_rng(0)
    lower, upper = mpc.input_limits
    output, wanted, disturbance = (
        max(np.abs(values).max(initial=0.0) for values in each) for each in zip(*record.samples(), strict=True)
    )
    if mpc.output_limits is not None:
        output = max(output, mpc.largest_output_bound)
    for i in range(_RANDOM_SAMPLES):
        held = rng.uniform(lower, upper)
        y = rng.uniform(-output, output, mpc.outputs)
        reference = rng.uniform(-1, 1, (mpc.reference_rows, mpc.outputs)) * max(wanted, output)
        w = rng.uniform(-disturbance, disturbance, mpc.measured_disturbances)

        def from_rest(controller: Controller, held=held, sample=(y, reference, w)) -> np.ndarray:
            controller.reset(held)
            return controller.step(*sample)

        worst = max(worst, _difference(pair, from_rest, f"random state {i}"))
    return worst


def _difference(pair: list[Controller], answer: Callable[[Controller], np.ndarray], where: str) -> float:
    double, single = pair
    exact, rounded = answer(double), answer(single)
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
