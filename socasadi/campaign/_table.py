"""All trials of a run as a table."""

import csv
import io
from collections.abc import Iterator
from dataclasses import asdict
from typing import Any

from ._result import Result
from .experiment import Units
from .store import Trial


def trials_csv(result: Result) -> str:
    """The trials of a run as CSV, one row a trial in the order of asking; a heading gives its unit in brackets.

    ``trial``, ``phase`` (seed or search), ``outcome`` (done, failed, cut, or pending while it was asked and not told),
    ``J``, ``literal J`` and ``rmse``, ``at_least`` (what J of a cut trial would have been at least), ``failure`` (the
    reason), the entries of theta by name, the values of the study's limits by name, ``seconds`` of wall time from ask
    to journal, ``plant_seconds`` of the robot's time and ``saved_seconds`` that were not flown, and ``asked`` (UTC). An
    empty cell is what there is not. Numbers are whole: read back, they are the same.
    """
    buffer = io.StringIO()
    rows = [*_rows(result)]
    write = csv.DictWriter(buffer, rows[0], lineterminator="\n")
    write.writerows(rows)
    return buffer.getvalue()


def _rows(result: Result) -> Iterator[dict[Any, Any]]:
    study, unit = result.study, Units.of(result.study.plant).output
    entries, limits = study.mpc.model.entries, study.limits
    # What a user names may be called like what is here: keys of another kind keep them apart.
    headings = {
        **{name: name for name in ("trial", "phase", "outcome", "J", "literal")},
        "rmse": f"rmse [{unit}]",
        **{name: name for name in ("at_least", "failure")},
        **{("entry", entry.name): _with_unit(entry.name, entry.unit) for entry in entries},
        **{("limit", limit.name): _with_unit(limit.name, limit.unit) for limit in limits},
        **{name: f"{name} [s]" for name in ("seconds", "plant_seconds", "saved_seconds")},
        "asked": "asked",
    }
    yield headings
    for trial in sorted([*result.trials, *result.pending], key=lambda trial: trial.number):
        row: dict[Any, Any] = {
            "trial": trial.number,
            "phase": trial.phase,
            "outcome": "pending",
            "asked": trial.started,
        }
        row |= {("entry", entry.name): value for entry, value in zip(entries, trial.theta.tolist(), strict=True)}
        if isinstance(trial, Trial):
            row |= {name: getattr(trial, name) for name in ("outcome", "J", "at_least", "failure")}
            row |= asdict(trial.score) if trial.score else {}
            row |= {("limit", name): value for name, value in (trial.measured or {}).items()}
            row["seconds"] = trial.seconds.get("trial")
            row |= {name: getattr(trial, name) for name in ("plant_seconds", "saved_seconds")}
        yield {name: row.get(name) for name in headings}


def _with_unit(name: str, unit: str) -> str:
    return f"{name} [{unit}]" if unit not in ("", "1") else name
