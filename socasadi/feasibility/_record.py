"""Is a probing record what it should be: its units, its columns, its rest."""

from collections.abc import Iterator
from itertools import permutations

import numpy as np

from ..campaign import Study, Units
from ..model import Record
from ._family import ON_RECORD, Mistake, family, fit
from ._finding import Finding

_ANOTHER_UNIT = 50.0
"""Factor from which on numbers are too large or too small to be in the same unit."""
_MOST_CABLES = 4
"""Up to so many are tried in another order."""
_LATEST = 6
"""Samples by which the robot may answer late."""
_OFF = 0.05
"""Share of the outputs' span by which they may be off zero at the start."""


def of_another_unit(study: Study, record: Record) -> list[Finding]:
    """What in a record is of quite another size than the study has it, or does not move at all."""
    mpc, of = study.mpc, Units.of(study.plant)
    varied = int(np.linalg.matrix_rank(record.tension - record.tension.mean(axis=0)))
    if varied < mpc.inputs:
        says = f"the inputs of the record vary in {varied} independent ways, and there are {mpc.inputs} of them"
        return [Finding("record", "infeasible", says, "a record in which every cable moves on its own")]
    rows = study.task.reference(mpc.sample_time * np.arange(study.task.samples(mpc.sample_time) + 1))
    limits = mpc.output_limits
    wide = np.abs([*limits, rows.min(0), rows.max(0)]) if limits else np.abs([rows.min(0), rows.max(0)])
    sizes = {
        "outputs": (np.ptp(record.output, axis=0).max(), np.max(wide, where=np.isfinite(wide), initial=0.0), of.output),
        "inputs": (np.ptp(record.tension, axis=0).max(), mpc.input_scale.max(), of.input),
    }
    findings = []
    for name, (found, meant, unit) in sizes.items():
        if meant and (found > _ANOTHER_UNIT * meant or found < meant / _ANOTHER_UNIT):
            times = f"{found / meant:,.3g} times what the study has, {meant:.3g} {unit}".rstrip()
            says = f"the {name} of the record span {found:.3g}, {times}"
            findings.append(Finding("record", "infeasible", says, f"a record whose {name} are in {unit or 'its unit'}"))
    return findings


def family_of_record(study: Study, record: Record) -> list[Finding]:
    """Can theta's family stand for what a record shows; if not, what would explain it?"""
    if study.mpc.measured_disturbances:
        return []
    return family(study, [fit(study, ON_RECORD, record)], [*mistakes(study, record)])


def mistakes(study: Study, record: Record) -> Iterator[Mistake]:
    """What people get wrong in a record, the likeliest first, each mended."""
    unit = Units.of(study.plant)
    time, u, y = record.sample_time, record.tension, record.output
    m, p = u.shape[1], y.shape[1]
    if (np.abs(y[0]) > _OFF * np.ptp(y, axis=0).max()).any():
        factor, shown = unit.shown
        rest = ", ".join(f"{factor * value:.3g}" for value in y[0])
        name = f"outputs counted from where it rests, ({rest}) {shown},"
        yield Mistake(name, "outputs that are 0 where the robot rests: subtract that", Record(time, u, y - y[0]))
    turned = Record(time, -u, y)
    yield Mistake("the sign of every input changed", "the signs: a positive input pulls towards its cable", turned)
    outputs = [order for order in permutations(range(p)) if p <= 2 or order == tuple(range(p))]
    inputs = [order for order in permutations(range(m)) if m <= _MOST_CABLES or order == tuple(range(m))]
    for rows in outputs:
        for order in inputs:
            names = [*_moved("y", rows), *_moved("u", order)]
            if names:
                name = f"the columns in the order {', '.join(names)}"
                moved = Record(time, u[:, list(order)], y[:, list(rows)])
                yield Mistake(name, "the order of the columns, or their signs", moved)
    for late in range(1, _LATEST + 1):
        name = f"inputs that act {late} {'sample' if late == 1 else 'samples'} late"
        yield Mistake(name, f"LinearMPC(delay={late + study.mpc.delay})", Record(time, u[:-late], y[late:]))


def _moved(kind: str, order: tuple[int, ...]) -> list[str]:
    return [f"{kind}{i + 1}" for i in order] if list(order) != sorted(order) else []
