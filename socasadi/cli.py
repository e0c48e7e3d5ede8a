"""The command ``socasadi``."""

import runpy
import shlex
import sys
import time
import traceback
import warnings
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, TextColumn
from rich.progress import Progress as Bar
from rich.table import Table

from .campaign import (
    Assessment,
    JournalError,
    Progress,
    Result,
    RunError,
    Study,
    Trial,
    assess,
    clock,
    emulate,
    interruptible,
    progress_line,
)
from .codegen import CompilationError
from .export import ExportError, NotBuiltError, build_and_replay
from .report import figures, save_figures

app = typer.Typer(
    help="Tune a soft robot's model predictive controller in closed loop, and get it as C.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)
# A file or a pipe has no width; a table must not be folded for it.
out = Console(highlight=False, soft_wrap=True, width=None if sys.stdout.isatty() else 120)

StudyFile = Annotated[Path, typer.Argument(help="Python file that defines `study`.")]
RunFolder = Annotated[Path, typer.Argument(metavar="RUN", help="Folder of a run.")]


@app.command()
def run(
    script: StudyFile,
    iterations: Annotated[int | None, typer.Option(help="Trials after the seed points.")] = None,
    seed: Annotated[int | None, typer.Option(help="Of the search and of the sensor's noise.")] = None,
    folder: Annotated[Path | None, typer.Option("--out", help="Run folder; runs/NAME by default.")] = None,
    resume: Annotated[bool, typer.Option("--resume", help="Go on with the run in that folder.")] = False,
) -> None:
    """Run a study: search, Sobol baseline, verification, figures, and the controller in C."""
    study = _load(script)
    changes = {"iterations": iterations, "seed": seed}
    study = replace(study, **{name: value for name, value in changes.items() if value is not None})
    folder = folder or Path("runs") / script.stem
    out.print(f"{script}: {study.trials} trials of {study.task.duration:g} s, into {folder}")
    start = time.monotonic()
    try:
        with interruptible():
            _run(study, folder, resume)
    except KeyboardInterrupt:
        out.print(f"\nStopped. Every finished trial is stored; go on with: {_again(script, folder, iterations, seed)}")
        raise typer.Exit(130) from None
    out.print(f"\n{clock(time.monotonic() - start)} in all")


@app.command()
def show(run_folder: RunFolder) -> None:
    """Print what a run has found."""
    result = Result.open(run_folder)
    table = Table(box=None, header_style="bold")
    for heading in ("trial", "phase", "J", "literal J", "RMSE / mm", "outcome"):
        table.add_column(heading, justify="left" if heading in ("phase", "outcome") else "right")
    for trial in result.trials:
        if trial.score is None:
            table.add_row(str(trial.number), trial.phase, "", "", "", f"failed: {trial.failure}")
        else:
            best = "best" if trial.number == result.best.number else ""
            score = trial.score
            numbers = (f"{score.J:.5g}", f"{score.literal:.5g}", f"{1e3 * score.rmse:.3f}")
            table.add_row(str(trial.number), trial.phase, *numbers, best)
    out.print(table)
    _theta(result, result.best)
    state = "complete" if result.complete else f"{len(result.trials)} of {result.study.trials} trials so far"
    out.print(f"\n{run_folder}: {state}")


@app.command()
def plot(
    run_folder: RunFolder,
    trial: Annotated[int | None, typer.Option(help="Trial whose episode is drawn; the best by default.")] = None,
) -> None:
    """Draw the figures of a run again."""
    result = Result.open(run_folder)
    beside = run_folder / "sobol"
    baseline = Result.open(beside).trials if beside.is_dir() else None
    for file in save_figures(figures(result, baseline, trial), run_folder / "figures"):
        out.print(str(file))


@app.command()
def export(
    run_folder: RunFolder,
    folder: Annotated[Path, typer.Option("--out", help="Folder for the C files.")],
    real: Annotated[str, typer.Option(help="What it computes in: double or float.")] = "double",
    solver: Annotated[str, typer.Option(help="QP solver: active-set or osqp.")] = "active-set",
    name: Annotated[str, typer.Option(help="Prefix of all that the C defines.")] = "controller",
) -> None:
    """Write the best controller of a run as C, build it and replay its episode."""
    Result.open(run_folder).export(folder, real=real, solver=solver, name=name)
    out.print(f"{folder}: {_replay(folder)}")


@app.command(name="emulate")
def emulate_(
    run_folder: RunFolder,
    real: Annotated[str, typer.Option(help="float (Cortex-M4F) or double (Cortex-M7).")] = "float",
) -> None:
    """Fly the best controller of a run on an emulated microcontroller, and say what it costs there."""
    with out.status("flying with the controller on an emulated microcontroller"):
        flown = emulate(Result.open(run_folder), real=real)  # pyright: ignore[reportArgumentType] (checked there)
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
    warnings.showwarning = lambda message, *_, **__: print(f"socasadi: {message}", file=sys.stderr)
    try:
        app()
    except (
        RunError,
        JournalError,
        ExportError,
        CompilationError,
        ValueError,
        TypeError,
        OSError,
    ) as error:
        print(f"socasadi: {error}", file=sys.stderr)
        sys.exit(1)


def _run(study: Study, folder: Path, resume: bool) -> None:
    with _progress("search") as progress:
        result = study.run(folder, resume=resume, progress=progress)
    with _progress("Sobol points, the baseline") as progress:
        baseline = study.sobol_only().run(folder / "sobol", resume=resume, progress=progress)
    rivals = {"Sobol": baseline.best.theta} if any(trial.J is not None for trial in baseline.trials) else {}
    with out.status("assessing") as status:
        assessment = assess(result, rivals, notify=status.update)
        status.update("drawing")
        files = save_figures(figures(result, baseline.trials), folder / "figures")
        status.update("exporting and building the controller")
        result.export(folder / "controller")
        replayed = _replay(folder / "controller")
    _summary(result, baseline, assessment)
    out.print(f"\ncontroller  {folder / 'controller'}\n            {replayed}")
    out.print(f"figures     {folder / 'figures'}: {', '.join(sorted({file.stem for file in files}))}")


def _again(script: Path, folder: Path, iterations: int | None, seed: int | None) -> str:
    """The command that goes on with a stopped run."""
    options = {"--iterations": iterations, "--seed": seed, "--out": folder}
    given = [f"{name} {shlex.quote(str(value))}" for name, value in options.items() if value is not None]
    return " ".join(["socasadi run", shlex.quote(str(script)), *given, "--resume"])


def _load(script: Path) -> Study:
    if not script.is_file():
        raise RunError(f"there is no study script {script}")
    # As when Python runs it: the script may import what lies beside it.
    sys.path.insert(0, str(script.parent))
    try:
        study = runpy.run_path(str(script), run_name="__study__").get("study")
    except SyntaxError as error:
        raise RunError(f"{error.filename}, line {error.lineno}: {error.msg}") from error
    except Exception as error:
        lines = [frame.lineno for frame in traceback.extract_tb(error.__traceback__) if frame.filename == str(script)]
        place = f"{script}, line {lines[-1]}" if lines else str(script)
        raise RunError(f"{place}: {type(error).__name__}: {error}") from error
    if not isinstance(study, Study):
        raise RunError(f"{script} defines no `study`: let it make one, study = Study(plant=..., mpc=..., task=...)")
    return study


def _replay(folder: Path) -> str:
    """What `make test` said; where it cannot be built, why."""
    try:
        return build_and_replay(folder)
    except NotBuiltError as error:
        return str(error)


@contextmanager
def _progress(title: str):
    """A reporter of trials: a bar on a terminal, and one line a trial elsewhere."""
    out.print(f"{title}:")
    if not out.is_terminal:
        yield lambda progress: out.print(progress_line(progress))
        return
    with Bar(BarColumn(12), MofNCompleteColumn(), TextColumn("{task.description}"), console=out) as bar:
        task = bar.add_task("", total=None)

        def report(progress: Progress) -> None:
            bar.update(
                task, total=progress.total, completed=progress.done, description=progress_line(progress, short=True)
            )

        yield report


def _summary(result: Result, baseline: Result, assessment: Assessment) -> None:
    failed = sum(trial.J is None for trial in result.trials)
    out.print(f"\nbest of {len(result.trials)} trials ({failed} failed): {_found(result)}")
    if any(trial.J is not None for trial in baseline.trials):
        out.print(f"best of {len(baseline.trials)} Sobol points: {_found(baseline)}")
    if assessment.verdicts:
        table = Table(box=None, header_style="bold", title_justify="left", title_style="")
        table.title = f"\neach theta flown {result.study.verifications} times under fresh noise:"
        for heading in ("theta", "J (median)", "RMSE / mm (median, worst)", "failed", "open-loop error / mm"):
            table.add_column(heading, justify="left" if heading == "theta" else "right")
        for name, verdict in assessment.verdicts.items():
            flown = ("-", "-")
            if len(verdict.J):
                rmse = 1e3 * verdict.rmse
                flown = (f"{np.median(verdict.J):.4g}", f"{np.median(rmse):.3f}, {rmse.max():.3f}")
            table.add_row(name, *flown, str(verdict.failed), f"{1e3 * verdict.prediction_error:.2f}")
        out.print(table)
        if assessment.unidentified:
            out.print(f"no model was identified: {assessment.unidentified}")
    _theta(result, result.best)


def _found(result: Result) -> str:
    best, score = result.best, result.best.score
    assert score is not None
    return f"J = {best.J:.4g} (trial {best.number}), literal J = {score.literal:.5g}, RMSE = {1e3 * score.rmse:.3f} mm"


def _theta(result: Result, trial: Trial) -> None:
    table = Table(
        box=None, show_header=False, title=f"\ntheta of trial {trial.number}:", title_justify="left", title_style=""
    )
    for entry, value in zip(result.study.mpc.model.entries, trial.theta, strict=True):
        table.add_row(
            f"  {entry.name}", f"{value:.5g}", entry.unit, f"[{entry.lower:g}, {entry.upper:g}]".replace("[", "\\[")
        )
    out.print(table)


if __name__ == "__main__":
    main()
