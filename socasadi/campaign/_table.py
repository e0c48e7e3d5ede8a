"""Trials and verdicts as tables: numbers for other programs, texts for people."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np

from ..model import Entry
from ..tune import Estimate, Space
from ._assess import Verdict
from ._result import Result
from .experiment import Limit, Units
from .store import Asked, Trial

if TYPE_CHECKING:
    from ._study import Study

_ON_BOUND = 0.005
"""Share of an entry's interval within which it is told to be on the bound."""


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
    entries, limits = study.mpc.entries, study.limits
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


def trial_row(trial: Asked, study: Study | None = None, *, best: bool = False) -> dict[str, str]:
    """A trial as it is told to people: texts by their heading, in order; empty where there is nothing.

    Parameters
    ----------
    trial
        Told, or asked only.
    study
        Where it is known: what the outputs are in, and what is limited. A value above its limit ends with "!".
    best
        Whether it is the best of its run.
    """
    told = trial if isinstance(trial, Trial) else None
    score, (factor, unit) = told and told.score, _shown(study)
    row = {
        "trial": str(trial.number),
        "phase": trial.phase,
        "J": "" if told is None or told.J is None else f"{told.J:.5g}",
        "literal J": f"{score.literal:.5g}" if score else "",
        f"RMSE / {unit}": f"{factor * score.rmse:.3f}" if score else "",
    }
    measured, broken = (told and told.measured) or {}, False
    for limit in study.limits if study else ():
        value = measured.get(limit.name)
        above = value is not None and value > limit.limit
        row[_per_unit(limit)] = "" if value is None else f"{value:.4g} {'!' if above else ' '}"
        broken = broken or above
    outcome = "not told yet" if told is None else told_outcome(told) if told.outcome != "done" else ""
    return row | {"outcome": outcome or ("best" if best else "broke a limit" if broken else "")}


def told_outcome(trial: Trial) -> str:
    """What came of a trial, in a few words."""
    match trial.outcome:
        case "failed":
            return f"failed: {trial.failure}"
        case "cut":
            return f"cut: J is at least {trial.at_least:.5g}"
        case "done":
            return f"J = {trial.J:.5g}"


def verdict_row(verdict: Verdict, study: Study) -> dict[str, str]:
    """A verdict as it is told to people: texts by their heading, in order."""
    factor, unit = _shown(study)
    flown, rmse, error = len(verdict.J), factor * verdict.rmse, factor * verdict.prediction_error
    return {
        "flights": str(flown + verdict.failed),
        "J, median": f"{np.median(verdict.J):.4g}" if flown else "-",
        f"RMSE / {unit}, median": f"{np.median(rmse):.3f}" if flown else "-",
        "worst": f"{rmse.max():.3f}" if flown else "-",
        "failed": str(verdict.failed),
        **({"broke a limit": str(verdict.broken)} if study.limits else {}),
        f"open-loop error / {unit}": f"{error:.2f}" if np.isfinite(error) else "-",
    }


def estimate_told(estimate: Estimate, trials: Sequence[Trial]) -> tuple[str, str]:
    """What is believed of the best J without noise, as it is told to people: J, and how sure that is.

    No J where its interval says nothing: an end of it is below what a sum of squares can be, or it is as wide as the
    costs are spread that it was made of.
    """
    spread = np.std([trial.J for trial in trials if trial.J is not None])
    if estimate.low <= 0 or estimate.high - estimate.low > spread:
        return "", "too few trials to say what the best is worth without noise"
    return f"{estimate.cost:.4g}", f"90 %: {estimate.low:.4g} to {estimate.high:.4g}"


def bound_notes(entries: Sequence[Entry], theta: np.ndarray) -> list[str]:
    """Which entries of a theta lie on a bound of theirs, so that a better one may lie beyond: a text each, or none."""
    at = Space(entries).to_unit(theta)
    return [
        "on its lower bound" if x < _ON_BOUND else "on its upper bound" if x > 1 - _ON_BOUND else ""
        for x in at.tolist()
    ]


def _shown(study: Study | None) -> tuple[float, str]:
    return (Units.of(study.plant) if study else Units()).shown


def _per_unit(limit: Limit) -> str:
    return f"{limit.name} / {limit.unit}" if limit.unit else limit.name
