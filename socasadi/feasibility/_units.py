"""Is a probing record in the units of its study."""

import numpy as np

from ..campaign import Study, Units
from ..model import Record
from ._finding import Finding

_ANOTHER_UNIT = 50.0
"""Factor from which on numbers are too large or too small to be in the same unit."""


def units(study: Study, record: Record) -> list[Finding]:
    """What in a record is of quite another size than the study has it."""
    mpc, of = study.mpc, Units.of(study.plant)
    rows = study.task.reference(mpc.sample_time * np.arange(study.task.samples(mpc.sample_time) + 1))
    limits = mpc.output_limits
    wide = np.abs([*limits, rows.min(0), rows.max(0)]) if limits else np.abs([rows.min(0), rows.max(0)])
    sizes = {
        "outputs": (np.ptp(record.output, axis=0).max(), np.max(wide, where=np.isfinite(wide), initial=0.0), of.output),
        "inputs": (np.abs(record.tension).max(), mpc.input_scale.max(), of.input),
    }
    findings = []
    for name, (found, meant, unit) in sizes.items():
        if meant and (found > _ANOTHER_UNIT * meant or found < meant / _ANOTHER_UNIT):
            says = f"the {name} of the record go over {found:.3g}, those of the study up to {meant:.3g} {unit}"
            findings.append(Finding("record", "infeasible", says, f"a record whose {name} are in {unit or 'its unit'}"))
    return findings
