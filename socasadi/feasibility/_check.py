from dataclasses import replace

import numpy as np

from ..campaign import Study
from ..model import Record
from ..plant import SimulatedPlant
from ..rod import EquilibriumError
from . import _arithmetic, _dynamics, _family, _statics
from ._case import Case
from ._finding import Check, Finding, Picture
from ._known import RodRobot, known
from ._record import family_of_record, mistakes, of_another_unit

_ASKED = (
    _statics.gravity,
    _statics.start,
    _statics.reach,
    _statics.pulling,
    _statics.bounds,
    _statics.holding,
    _dynamics.following,
    _dynamics.timing,
    _dynamics.noise,
    _dynamics.pulse,
)


def check(
    study: Study, *, plant: SimulatedPlant | None = None, record: Record | None = None, quick: bool = False
) -> Check:
    """Whether the robot can do the task with a controller of this make, and what stands against it.

    No experiment is made, and nothing of this needs the robot. What is known of it is the rod of a simulated plant;
    of a real one a data sheet's rod, a short probing record, or both; without these the middle of theta's bounds.

    Parameters
    ----------
    plant
        A stand-in for a plant that is not simulated, such as :func:`read_spec_sheet` makes.
    record
        A short probing record of the robot: how it moves is taken from it, and how noisy its sensor is.
    quick
        Leave out what takes longer than a moment: whether theta's family can stand for the robot, the loop's
        stability, and the arithmetic.

    Raises
    ------
    ValueError
        The stand-in or the record has other inputs, outputs or another sample time than the study.
    """
    if plant is None and isinstance(study.plant, SimulatedPlant):
        plant = study.plant
    _check_fit(study, plant, record)
    if record is not None and (mistaken := of_another_unit(study, record)):  # all else would be nonsense
        return Check("the probing record", tuple(mistaken))
    robot, noise = known(study, plant, record)
    rod = getattr(robot, "statics", robot)
    if isinstance(rod, RodRobot) and (curled := _statics.curled(study, rod)):
        return Check(rod.source, tuple(curled))
    if robot is None:
        says = "the bounds of theta do not even tell which way the inputs move it, and nothing else is known"
        advice = "a probing record (--record) or a data sheet (--spec), and check again"
        return Check("nothing", (Finding("robot", "unknown", says, advice),))
    case = Case(study, robot, noise, record)
    findings: list[Finding] = []
    try:
        for question in _ASKED:
            findings += question(case)
        # A robot that does not stand has no linear model worth fitting.
        stands = not any(finding.name == "gravity" and finding.verdict == "infeasible" for finding in findings)
        guessed = plant is None and record is None
        if not quick and stands and not guessed and not study.mpc.measured_disturbances:
            fits = _family.fits(case)
            findings += _family.family(study, fits, [*mistakes(study, record)] if record is not None else ())
            if all(finding.verdict != "infeasible" for finding in findings):
                findings += _arithmetic.arithmetic(case, fits[0].theta)
    except EquilibriumError as error:
        findings.append(Finding("rest", "infeasible", str(error), "a stiffer arm, or smaller loads"))
    if plant is None and record is None:  # of a guess nothing is certain
        findings = [replace(f, verdict="doubtful") if f.verdict == "infeasible" else f for f in findings]
    return Check(robot.source, tuple(findings), _picture(case) if study.mpc.outputs == 2 else None)


def check_record(study: Study, record: Record) -> Check:
    """Whether a probing record is one of this study's robot: its units, and whether theta's family can stand for it.

    Raises
    ------
    ValueError
        It has other inputs, outputs or another sample time than the study.
    """
    _check_fit(study, None, record)
    findings = of_another_unit(study, record) or family_of_record(study, record)
    return Check("the probing record", tuple(findings))


def _check_fit(study: Study, plant: SimulatedPlant | None, record: Record | None) -> None:
    mpc = study.mpc
    given: list[tuple[str, SimulatedPlant | Record, tuple[int, int]]] = []
    if plant is not None:
        given.append(("data sheet", plant, (plant.inputs, plant.outputs)))
    if record is not None:
        given.append(("probing record", record, (record.tension.shape[1], record.output.shape[1])))
    for name, part, sizes in given:
        if sizes != (mpc.inputs, mpc.outputs):
            raise ValueError(
                f"the {name} has {sizes[0]} inputs and {sizes[1]} outputs, but the study {mpc.inputs} and {mpc.outputs}"
            )
        if not np.isclose(part.sample_time, mpc.sample_time, rtol=1e-6):
            raise ValueError(
                f"the {name} is sampled every {part.sample_time:g} s, but the study every {mpc.sample_time:g} s"
            )


def _picture(case: Case) -> Picture | None:
    try:
        return Picture(
            shown=case.units.shown,
            reach=case.corners(case.bounds),
            pulling=None if case.pulling is None else case.corners(case.pulling),
            rest=case.rest.output,
            start=case.begun.output,
            reference=case.reference,
            bounds=case.study.mpc.output_limits,
        )
    except EquilibriumError:
        return None
