"""How the command prints."""

import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.console import Console
from rich.table import Table

from .campaign import Asked, Result, RunError, Study, Trial, Units, Verdict, clock
from .export import NotBuiltError, build_and_replay

StudyFile = Annotated[Path, typer.Argument(metavar="STUDY", help="Python file that defines `study`.")]
RunFolder = Annotated[Path, typer.Argument(metavar="RUN", help="Folder of a run.")]

# A file or a pipe has no width; a table must not be folded for it.
out = Console(highlight=False, soft_wrap=True, width=None if sys.stdout.isatty() else 120)


def table(*headings: str, left: tuple[str, ...] = (), title: str = "") -> Table:
    """A table without lines, its columns at the right but for those ``left``."""
    made = Table(box=None, header_style="bold", title=title or None, title_justify="left", title_style="")
    for heading in headings:
        made.add_column(heading, justify="left" if heading in left else "right")
    return made


def distance(study: Study) -> tuple[float, str]:
    """How many of the unit in which distances are printed are in one of the study's own, and that unit: mm for m."""
    unit = Units.of(study.plant).output
    return (1e3, "mm") if unit == "m" else (1.0, unit)


def print_theta(study: Study, trial: Asked, title: str) -> None:
    """The entries of a theta by name, with their bounds."""
    listed = Table(box=None, show_header=False, title=title, title_justify="left", title_style="")
    for entry, value in zip(study.mpc.model.entries, trial.theta, strict=True):
        bounds = f"\\[{entry.lower:g}, {entry.upper:g}]"
        listed.add_row(f"  {entry.name}", f"{value:.5g}", entry.unit, bounds)
    out.print(listed)


def best_of(result: Result) -> Trial | None:
    """The best trial; None while there is none."""
    try:
        return result.best
    except RunError:
        return None


def found(result: Result) -> str:
    """The best trial in a line."""
    best = result.best
    score = best.score
    factor, unit = distance(result.study)
    told = [f"J = {best.J:.4g} (trial {best.number})"]
    if score is not None:
        told += [f"literal J = {score.literal:.5g}", f"RMSE = {factor * score.rmse:.3f} {unit}"]
    for limit in result.study.limits:
        told.append(f"{limit.name} = {(best.measured or {})[limit.name]:.4g} {limit.unit}".rstrip())
    return ", ".join(told)


def outcome(trial: Trial) -> str:
    """What came of a trial, in a few words."""
    match trial.outcome:
        case "failed":
            return f"failed: {trial.failure}"
        case "cut":
            return f"cut: J is at least {trial.at_least:.5g}"
        case "done":
            return f"J = {trial.J:.5g}"


def print_chosen(result: Result) -> None:
    """The theta whose controller is exported."""
    chosen = result.chosen
    why = "" if chosen.number == result.best.number else ", the best of those that were flown again"
    print_theta(result.study, chosen, f"\ntheta of trial {chosen.number}{why}:")


def print_verdicts(study: Study, verdicts: Mapping[str, Verdict]) -> None:
    """What each theta was worth when it was flown again."""
    factor, unit = distance(study)
    limited = ("broke a limit",) if study.limits else ()
    headings = ("theta", "flights", "J (median)", f"RMSE / {unit} (median, worst)", "failed", *limited)
    listed = table(*headings, f"open-loop error / {unit}", left=("theta",), title="\nflown under fresh noise:")
    for name, verdict in verdicts.items():
        flown = ("-", "-")
        if len(verdict.J):
            rmse = factor * verdict.rmse
            flown = (f"{np.median(verdict.J):.4g}", f"{np.median(rmse):.3f}, {rmse.max():.3f}")
        counts = (str(verdict.failed), str(verdict.broken)) if limited else (str(verdict.failed),)
        flights = str(len(verdict.J) + verdict.failed)
        listed.add_row(name, flights, *flown, *counts, f"{factor * verdict.prediction_error:.2f}")
    out.print(listed)


def spared(result: Result) -> str:
    """What cutting hopeless trials has spared the robot; nothing where nothing was."""
    if not result.saved_seconds:
        return ""
    cut = sum(trial.outcome == "cut" for trial in result.trials)
    flown, kept = (clock(seconds) for seconds in (result.plant_seconds, result.saved_seconds))
    trials = "1 hopeless trial" if cut == 1 else f"{cut} hopeless trials"
    return f"; the robot moved for {flown}, and was spared {kept} by cutting {trials} short"


def replay(folder: Path) -> str:
    """What `make test` said; where it cannot be built, why."""
    try:
        return build_and_replay(folder)
    except NotBuiltError as error:
        return str(error)
