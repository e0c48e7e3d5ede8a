"""The command that runs a study from its first trial to its C."""

import shlex
import time
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from rich.progress import BarColumn, MofNCompleteColumn, TextColumn
from rich.progress import Progress as Bar

from ._terminal import (
    Anyway,
    ProbeRecord,
    StudyFile,
    best_of,
    estimated,
    found,
    out,
    print_check,
    print_chosen,
    print_verdicts,
    replay,
    spared,
    starting_from,
)
from .campaign import (
    Assessment,
    Progress,
    Result,
    RunError,
    Study,
    assess,
    check_run,
    clock,
    dask_executor,
    interruptible,
    load_study,
    progress_line,
)
from .feasibility import check


def run(
    script: StudyFile,
    iterations: Annotated[int | None, typer.Option(help="Trials after the seed points.")] = None,
    seed: Annotated[int | None, typer.Option(help="Of the search and of the sensor's noise.")] = None,
    folder: Annotated[Path | None, typer.Option("--out", help="Run folder; runs/NAME by default.")] = None,
    resume: Annotated[bool, typer.Option("--resume", help="Go on with the run in that folder.")] = False,
    jobs: Annotated[int | None, typer.Option(help="How many trials at once, in as many processes.")] = None,
    dask: Annotated[str | None, typer.Option(metavar="ADDRESS", help="Dask scheduler whose workers fly them.")] = None,
    start: Annotated[
        list[Path] | None, typer.Option(metavar="RUN", help="Earlier run whose best theta is tried first.")
    ] = None,
    record: ProbeRecord = None,
    anyway: Anyway = False,
) -> None:
    """Run a study: search, Sobol baseline, verification, figures, and the controller in C."""
    if jobs is not None and jobs < 1:
        raise RunError(f"--jobs is at least 1, not {jobs}")
    study = starting_from(load_study(script), record, anyway)
    given: dict[str, Any] = {"iterations": iterations, "seed": seed}
    if start:
        given["initial"] = (*(_best_theta(study, earlier) for earlier in start), *study.initial)
    study = replace(study, **{name: value for name, value in given.items() if value is not None})
    folder = folder or Path("runs") / script.stem
    check_run(study, folder, resume=resume)
    out.print(f"{script}: {study.trials} trials of {study.task.duration:g} s, into {folder}")
    checked = check(study, quick=True)
    against = checked.objections
    out.print("check: what stands against it" if against else "check: nothing stands against it")
    print_check(against)
    began = time.monotonic()
    try:
        with interruptible(), ExitStack() as stack:
            executor = stack.enter_context(dask_executor(dask)) if dask else None
            _run(study, folder, resume, {"jobs": jobs, "executor": executor, "script": script})
    except KeyboardInterrupt:
        options = {"--iterations": iterations, "--seed": seed, "--out": folder, "--jobs": jobs, "--dask": dask}
        options |= {"--record": record}
        given_options = [*options.items(), *(("--start", earlier) for earlier in start or ())]
        out.print(f"\nStopped. Every finished trial is stored; go on with: {_again(script, given_options)}")
        raise typer.Exit(130) from None
    out.print(f"\n{clock(time.monotonic() - began)} in all")
    if checked.verdict == "infeasible":
        named = ", ".join(finding.name for finding in against if finding.verdict == "infeasible")
        out.print(f"the check before it called it infeasible ({named}): socasadi check {shlex.quote(str(script))}")


def _run(study: Study, folder: Path, resume: bool, flown: dict[str, Any]) -> None:
    from .report import figures, save_figures  # matplotlib takes its time

    with _progress("search") as progress:
        result = study.run(folder, resume=resume, progress=progress, **flown)
    with _progress("Sobol points, the baseline") as progress:
        baseline = study.sobol_only().run(folder / "sobol", resume=resume, progress=progress, **flown)
    rivals = {"Sobol": sobol.theta} if (sobol := best_of(baseline)) is not None else {}
    with out.status("assessing") as status:
        assessment = assess(result, rivals, notify=status.update)
        status.update("drawing")
        files = save_figures(figures(result, baseline.trials), folder / "figures")
        status.update("exporting and building the controller")
        result.export(folder / "controller")
        replayed = replay(folder / "controller")
    _summary(result, baseline, assessment)
    out.print(f"\ncontroller  {folder / 'controller'}\n            {replayed}")
    out.print(f"figures     {folder / 'figures'}: {', '.join(sorted({file.stem for file in files}))}")
    out.print(f"to look at  socasadi report {shlex.quote(str(folder))}")


def _again(script: Path, options: list[tuple[str, Any]]) -> str:
    """The command that goes on with a stopped run."""
    given = [f"{name} {shlex.quote(str(value))}" for name, value in options if value is not None]
    return " ".join(["socasadi run", shlex.quote(str(script)), *given, "--resume"])


def _best_theta(study: Study, folder: Path) -> np.ndarray:
    """The theta that an earlier run found, if this study's model has the same entries."""
    result = Result.open(folder)
    here, there = ([f"{entry.name} {entry.unit}" for entry in of.mpc.entries] for of in (study, result.study))
    if here != there:
        raise RunError(f"{folder} cannot be a start: its theta is {', '.join(there)}; this study's {', '.join(here)}")
    theta = result.chosen.theta
    for entry, value in zip(study.mpc.entries, theta, strict=True):
        if not entry.lower <= value <= entry.upper:
            raise RunError(
                f"{folder} cannot be a start: its {entry.name} is {value:.5g} {entry.unit}, outside this study's "
                f"bounds {entry.lower:g} and {entry.upper:g}"
            )
    return theta


@contextmanager
def _progress(title: str):
    """A reporter of trials: a bar on a terminal, and one line a trial elsewhere."""
    out.print(f"{title}:")
    if not out.is_terminal:
        yield lambda progress: out.print(progress_line(progress))
        return
    with Bar(BarColumn(12), MofNCompleteColumn(), TextColumn("{task.description}", markup=False), console=out) as bar:
        task = bar.add_task("", total=None)

        def report(progress: Progress) -> None:
            bar.update(
                task, total=progress.total, completed=progress.done, description=progress_line(progress, short=True)
            )

        yield report


def _summary(result: Result, baseline: Result, assessment: Assessment) -> None:
    counts = {outcome: sum(trial.outcome == outcome for trial in result.trials) for outcome in ("failed", "cut")}
    out.print(f"\nbest of {len(result.trials)} trials ({_counted(counts)}): {found(result)}")
    if told := estimated(result):
        out.print(told)
    if best_of(baseline) is not None:
        out.print(f"best of {len(baseline.trials)} Sobol points: {found(baseline)}")
    if told := spared(result):
        out.print(told.removeprefix("; "))
    if assessment.verdicts:
        print_verdicts(result.study, assessment.verdicts)
        if assessment.unidentified:
            out.print(f"no model was identified: {assessment.unidentified}")
    print_chosen(result)


def _counted(counts: dict[str, int]) -> str:
    told = [f"{number} {outcome}" for outcome, number in counts.items() if number or outcome == "failed"]
    return ", ".join(told)
