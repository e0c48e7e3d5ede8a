"""The command ``socasadi``."""

import importlib.metadata
import sys
import warnings
from io import TextIOWrapper
from pathlib import Path
from typing import Annotated

import typer
from rich.table import Table

from ._bench_commands import ask, init, tell
from ._check_command import RobotRecord, SpecSheet, check_, checked
from ._compare_command import compare
from ._run_command import run
from ._sparkline import sparkline
from ._terminal import (
    RunFolder,
    StudyScript,
    best_of,
    counting,
    estimated,
    opened,
    out,
    print_chosen,
    print_contents,
    print_verdicts,
    replay,
    spared,
    table,
)
from .campaign import (
    JournalError,
    Result,
    RunError,
    assessed,
    emulate,
    told_outcome,
    trial_row,
    trials_csv,
)
from .codegen import CompilationError
from .export import ExportError
from .plant import ExternalPlantError

app = typer.Typer(
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)


def _version(wanted: bool) -> None:
    if wanted:
        print(f"socasadi {importlib.metadata.version('socasadi')}")
        raise typer.Exit


@app.callback()
def _about(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version and exit.")
    ] = False,
) -> None:
    """Tune a soft robot's model predictive controller in closed loop, and get it as C."""


app.command(name="check")(check_)
for command in (run, init, ask, tell, compare):
    app.command()(command)


@app.command()
def show(
    run_folder: RunFolder,
    csv: Annotated[
        Path | None,
        typer.Option("--csv", metavar="FILE", help="Write all trials there as CSV, with units; - prints them."),
    ] = None,
    script: StudyScript = None,
) -> None:
    """Print what a run has found, or write its trials to a file."""
    result = opened(run_folder, script)
    if csv == Path("-"):
        print(trials_csv(result), end="")
        return
    if csv is not None:
        csv.write_text(trials_csv(result), encoding="utf-8")
        out.print(f"{csv}: {len(result.trials) + len(result.pending)} trials")
        return
    study, best = result.study, best_of(result)
    asked = sorted([*result.trials, *result.pending], key=lambda trial: trial.number)
    if not asked:
        out.print(result.begin)
        return
    rows = [trial_row(trial, study, best=best is not None and trial.number == best.number) for trial in asked]
    out.print(table(rows, left=("phase", "outcome")))
    if study.limits:
        most = ", ".join(f"{limit.name} {limit.limit:g} {limit.unit}".rstrip() for limit in study.limits)
        out.print(f"limits: {most}; ! is above its limit")
    for trial in result.taken_back:
        out.print(f"taken back: trial {trial.number}, told as {told_outcome(trial)}")
    if lines := sparkline(result.trials, result.kept, out.width, out.encoding):
        out.print("", *lines, sep="\n")
    if told := estimated(result):
        out.print(told)
    if verdicts := assessed(result):
        print_verdicts(study, verdicts)
    if best is not None:
        print_chosen(result)
    state = "complete" if result.complete else f"{len(result.trials)} of {study.trials} trials so far"
    out.print(f"\n{run_folder}: {state}{spared(result)}")
    print_contents(run_folder)


@app.command()
def plot(
    run_folder: RunFolder,
    trial: Annotated[int | None, typer.Option(help="Trial whose episode is drawn; the best by default.")] = None,
    animation: Annotated[
        Path | None,
        typer.Option("--animate", metavar="FILE", help="Animate the episode instead, in FILE.mp4 or FILE.gif."),
    ] = None,
    script: StudyScript = None,
) -> None:
    """Draw the figures of a run again, or an animation of one episode."""
    from .report import animate, figures, save_figures  # matplotlib takes its time

    result = opened(run_folder, script)
    if animation is not None:
        with counting(f"frames of {animation}") as progress:
            animate(result, animation, trial, progress=progress)
        out.print(f"{animation}: {animation.stat().st_size / 1e6:.2g} MB")
        return
    beside = run_folder / "sobol"
    baseline = Result(result.study, beside).trials if beside.is_dir() else None
    for file in save_figures(figures(result, baseline, trial), run_folder / "figures"):
        out.print(str(file))
    shown = result.best.number if trial is None else trial
    if result.recorded(shown):
        exported = result.chosen.number
        of = " (the best observed)" if shown == result.best.number else ""
        also = f"; exported is the controller of trial {exported}" if exported != shown else ""
        out.print(f"drawn is the episode of trial {shown}{of}{also}")


@app.command()
def report(
    run_folder: RunFolder,
    file: Annotated[
        Path | None, typer.Option("--out", metavar="FILE", help="Where to write; report.html in RUN by default.")
    ] = None,
    script: StudyScript = None,
    spec: SpecSheet = None,
    record: RobotRecord = None,
) -> None:
    """Write a run as one HTML file that opens from disk: all its figures, and the rod moving."""
    from .report import write_report

    with out.status("reporting"):
        study = None if script is None else opened(run_folder, script).study
        told = spec is not None or record is not None
        found = checked(study or opened(run_folder, None).study, spec, record) if told else None
        written = write_report(run_folder, file, study, found)
    out.print(f"{written.file}: {written.file.stat().st_size / 1e6:.1f} MB, for any browser")
    if written.lacks:
        print("What this report lacks:", *written.lacks, sep="\n  ", file=sys.stderr)
    if written.damaged:
        raise typer.Exit(1)


@app.command()
def export(
    run_folder: RunFolder,
    folder: Annotated[Path, typer.Option("--out", help="Folder for the C files.")],
    real: Annotated[str, typer.Option(help="What it computes in: double or float.")] = "double",
    solver: Annotated[str, typer.Option(help="QP solver: active-set or osqp.")] = "active-set",
    name: Annotated[str, typer.Option(help="Prefix of all that the C defines.")] = "controller",
    script: StudyScript = None,
) -> None:
    """Write the best controller of a run as C, build it and replay its episode."""
    opened(run_folder, script).export(folder, real=real, solver=solver, name=name)
    out.print(f"{folder}: {replay(folder)}")


@app.command(name="emulate")
def emulate_(
    run_folder: RunFolder,
    real: Annotated[str, typer.Option(help="float (Cortex-M4F) or double (Cortex-M7).")] = "float",
    script: StudyScript = None,
) -> None:
    """Fly the best controller of a run on an emulated microcontroller, and say what it costs there."""
    with out.status("flying with the controller on an emulated microcontroller"):
        flown = emulate(opened(run_folder, script), real=real)  # pyright: ignore[reportArgumentType] (checked there)
    footprint, worst = flown.footprint, flown.worst
    seconds = len(flown.episode.tension) * flown.episode.sample_time
    table = Table(box=None, show_header=False, padding=(0, 2, 0, 0))
    table.add_row("processor", f"{flown.core}, {flown.real} (emulated)")
    table.add_row("episode", f"{seconds:g} s, {flown.episode.fallbacks} fallbacks")
    table.add_row("inputs against the same C here", f"{flown.difference:.1e} of the bound at most")
    table.add_row("flash, RAM, stack", f"{worst.flash / 1e3:.1f} kB, {worst.ram / 1e3:.1f} kB, {worst.stack} bytes")
    for name, of in (("of the episode", footprint), ("random samples, too", worst)):
        table.add_row(
            f"instructions a step, {name}",
            f"{of.instructions_median:,} in the median, {of.instructions_worst:,} at worst "
            f"({of.iterations_worst} iterations)",
        )
    out.print(table)


def main() -> None:
    """Entry point: errors that a user can mend are one sentence, without a traceback."""
    if isinstance(sys.stdout, TextIOWrapper):  # as its stderr does, where a name holds what cannot be encoded
        sys.stdout.reconfigure(errors="backslashreplace")
    warnings.showwarning = lambda message, *_, **__: print(f"socasadi: {message}", file=sys.stderr)
    try:
        app()
    except (
        RunError,
        JournalError,
        ExportError,
        CompilationError,
        ExternalPlantError,
        ValueError,
        TypeError,
        OSError,
    ) as error:
        print(f"socasadi: {error}", file=sys.stderr)
        sys.exit(1)


if __name__ == "__main__":
    main()
