"""What the commands share: how they open a run, and how they print."""

import sys
import textwrap
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn
from rich.table import Table

from .campaign import (
    Asked,
    Result,
    RunError,
    Study,
    Trial,
    Units,
    Verdict,
    bound_notes,
    clock,
    estimate_told,
    load_study,
    read_probe,
    verdict_row,
)
from .campaign.store import compare_settings, journal_path, read_settings
from .export import NotBuiltError, build_and_replay
from .feasibility import Finding, check_record
from .model import identify

StudyFile = Annotated[Path, typer.Argument(metavar="STUDY", help="Python file that defines `study`.")]
RunFolder = Annotated[Path, typer.Argument(metavar="RUN", help="Folder of a run.")]
StudyScript = Annotated[
    Path | None, typer.Option("--study", help="Its script, where a part of the study is of your own making.")
]

ProbeRecord = Annotated[
    Path | None,
    typer.Option("--record", metavar="FILE", help="Probing record (CSV): what fits it is tried first."),
]

Anyway = Annotated[bool, typer.Option("--anyway", help="Start from the record whatever the check says of it.")]

# A file or a pipe has no width; a table must not be folded for it.
# Nothing is markup: what a robot says when it fails, or the name of a folder, may hold brackets.
out = Console(highlight=False, markup=False, soft_wrap=True, width=None if sys.stdout.isatty() else 120)


def opened(folder: Path, script: Path | None) -> Result:
    """The run, its study from its folder or from its script."""
    if script is None:
        try:
            return Result.open(folder)
        except RunError as error:
            if "can only be made by the study script" in str(error):
                raise RunError(f"{error}: name it by --study") from error
            raise
    if not folder.is_dir():
        raise RunError(f"there is no run folder {folder}")
    settings = read_settings(folder)
    kept = {name: settings[name] for name in ("iterations", "seed", "verifications") if name in settings}
    study = replace(load_study(script), **kept)
    compare_settings(folder, study.settings)
    return Result(study, folder)


def starting_from(study: Study, record: Path | None, anyway: bool) -> Study:
    """The study with the theta within its bounds that fits a probing record best as its first point.

    Raises
    ------
    RunError
        The record is not one of this study's robot, as far as can be seen; ``anyway`` takes it all the same.
    """
    if record is None:
        return study
    probed = read_probe(record, study)
    against = check_record(study, probed)
    print_check(against.objections)
    if against.verdict == "infeasible" and not anyway:
        raise RunError(f"{record} is no record to start from, see above; --anyway takes it all the same")
    found = identify(study.mpc.model, probed)
    return replace(study, initial=(study.mpc.whole(found), *study.initial))


def table(rows: Sequence[Mapping[str, str]], left: tuple[str, ...] = (), title: str = "") -> Table:
    """A table without lines, texts by heading; columns at the right but for those ``left``, which are not folded."""
    made = Table(box=None, header_style="bold", title=title or None, title_justify="left", title_style="")
    for heading in rows[0] if rows else ():
        made.add_column(heading, justify="left" if heading in left else "right", no_wrap=heading in left)
    for row in rows:
        made.add_row(*row.values())
    return made


def distance(study: Study) -> tuple[float, str]:
    """How many of the unit in which distances are printed are in one of the study's own, and that unit: mm for m."""
    return Units.of(study.plant).shown


def print_theta(study: Study, trial: Asked, title: str) -> None:
    """The entries of a theta by name, with their bounds."""
    listed = Table(box=None, show_header=False, title=title, title_justify="left", title_style="")
    entries = study.mpc.entries
    for entry, value, note in zip(entries, trial.theta, bound_notes(entries, trial.theta), strict=True):
        listed.add_row(f"  {entry.name}", f"{value:.5g}", entry.unit, f"[{entry.lower:g}, {entry.upper:g}]", note)
    out.print(listed)


def print_check(findings: Sequence[Finding]) -> None:
    """What a check found, a line or a few each, with what to change below."""
    width = out.width if out.is_terminal else 120
    for finding in findings:
        head = f"  {finding.verdict:<10}  {finding.name:<16}  "
        rest = " " * len(head)
        style = {"infeasible": "bold red", "doubtful": "yellow", "unknown": "cyan"}.get(finding.verdict)
        said = textwrap.fill(finding.says, width, initial_indent=head, subsequent_indent=rest)
        out.print(said, style=style)
        if finding.advice:
            out.print(textwrap.fill(f"-> {finding.advice}", width, initial_indent=rest, subsequent_indent=rest + "   "))


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


def estimated(result: Result) -> str:
    """The best trial without the luck of its noise, in a line; nothing before there is one."""
    if (estimate := result.best_estimated) is None:
        return ""
    cost, sure = estimate_told(estimate, result.trials)
    number = result.trials[estimate.index].number
    return f"best without noise, as estimated: J = {cost} ({sure}), trial {number}" if cost else sure


def print_chosen(result: Result) -> None:
    """The theta whose controller is exported."""
    chosen = result.chosen
    why = "" if chosen.number == result.best.number else ", the best of those that were flown again"
    print_theta(result.study, chosen, f"\ntheta of trial {chosen.number}{why}:")


def print_verdicts(study: Study, verdicts: Mapping[str, Verdict]) -> None:
    """What each theta was worth when it was flown again."""
    rows = [{"theta": name} | verdict_row(verdict, study) for name, verdict in verdicts.items()]
    out.print(table(rows, left=("theta",), title="\nflown under fresh noise:"))


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


@contextmanager
def counting(what: str) -> Iterator[Callable[[int, int], None]]:
    """What takes how much is done, and of how much: a bar on a terminal, nothing elsewhere."""
    if not out.is_terminal:
        yield lambda done, total: None
        return
    with Progress(BarColumn(12), MofNCompleteColumn(), TextColumn("{task.description}"), console=out) as bar:
        task = bar.add_task(what, total=None)
        yield lambda done, total: bar.update(task, completed=done, total=total)


def print_contents(folder: Path) -> None:
    """What a run folder holds, each with its path."""
    figures = sorted({file.stem for file in (folder / "figures").glob("*")})
    held = {
        "journal": (journal_path(folder), ""),
        "figures": (folder / "figures", f": {', '.join(figures)}"),
        "controller": (folder / "controller", ", in C"),
        "Sobol points": (folder / "sobol", ", the baseline: a run of its own"),
        "report": (folder / "report.html", ""),
    }
    for name, (path, note) in held.items():
        if path.exists():
            out.print(f"  {name:12}  {path}{note}")
