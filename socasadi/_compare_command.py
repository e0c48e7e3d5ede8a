"""The command that sets methods beside each other."""

import csv
import os
import time
from contextlib import ExitStack
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from ._terminal import out, table
from .campaign import Processes, RunError, clock, dask_executor
from .campaign.experiment import interruptible


def compare(
    script: Annotated[Path, typer.Argument(metavar="SCRIPT", help="Python file that defines `comparison`.")],
    smoke: Annotated[bool, typer.Option("--smoke", help="Whether it works: under two minutes.")] = False,
    quick: Annotated[
        bool, typer.Option("--quick", help="Three seeds, 30 episodes' worth of the robot's time.")
    ] = False,
    tasks: Annotated[
        list[str] | None, typer.Option("--task", metavar="NAME", help="Only this task; repeatable.")
    ] = None,
    methods: Annotated[
        list[str] | None, typer.Option("--method", metavar="NAME", help="Only this method; repeatable.")
    ] = None,
    seeds: Annotated[int | None, typer.Option(metavar="N", help="Only the first N seeds.")] = None,
    jobs: Annotated[int | None, typer.Option(help="How many cells at once; all processors by default.")] = None,
    dask: Annotated[str | None, typer.Option(metavar="ADDRESS", help="Dask scheduler whose workers fly them.")] = None,
    folder: Annotated[Path | None, typer.Option("--out", help="Its results; runs/NAME-SIZE by default.")] = None,
) -> None:
    """Compare ways to get a controller at equal cost. A stopped comparison goes on when it is given again."""
    from .baselines import Summary, load_comparison, run_comparison, summary_table
    from .report import comparison_figures, save_figures  # matplotlib takes its time

    if smoke and quick:
        raise RunError("--smoke and --quick are two sizes: give one")
    if jobs is not None and jobs < 1:
        raise RunError(f"--jobs is at least 1, not {jobs}")
    size = "smoke" if smoke else "quick" if quick else "full"
    parts = {"tasks": tasks or (), "methods": methods or (), "seeds": seeds}
    comparison = load_comparison(script, size).of_parts(**parts)
    folder = folder or Path("runs") / f"{script.stem}-{size}"
    out.print(
        f"{script}, {size}: {comparison.extent}, {comparison.checkpoints[-1]} episodes' worth of the robot's time for "
        f"each method, into {folder}"
    )
    began, first = time.monotonic(), [0]

    def told(cell: dict[str, Any], done: int, total: int) -> None:
        first[0] = first[0] or done
        elapsed = time.monotonic() - began
        left = elapsed / (done - first[0] + 1) * (total - done)
        out.print(f"[{done}/{total}] {_line(cell)}; {clock(elapsed)} so far, {clock(left)} left")

    try:
        with interruptible(), ExitStack() as stack:
            here = jobs or os.cpu_count() or 1
            executor = stack.enter_context(dask_executor(dask) if dask else Processes(here))
            cells = run_comparison(script, size, folder, executor, told, **parts)
    except KeyboardInterrupt:
        out.print("\nStopped. Every finished cell is stored; the same command goes on.")
        raise typer.Exit(130) from None
    summary = Summary.of(cells, list(comparison.tasks), list(comparison.methods))
    rows = summary_table(summary)
    for task in summary.tasks:
        shown = [{k: v for k, v in row.items() if k not in ("task", "knows")} for row in rows if row["task"] == task]
        title = f"\n{task}, after {summary.checkpoints[-1]} episodes' worth of the robot's time:"
        out.print(table(shown, left=("method",), title=title))
    files = [_written(rows, folder / "table.csv")]
    if rivals := _rivals(summary):
        out.print(table(rivals, left=("method", "knows"), title=f"\n{summary.methods[0]} against, in J:"))
        files.append(_written(rivals, folder / "against.csv"))
    for task in comparison.elsewhere_on:
        if not (others := _elsewhere(summary, task)):
            continue  # no method had a controller to fly there
        out.print(table(others, left=("method",), title=f"\n{task}, J on other robots:"))
        files.append(_written(others, folder / f"elsewhere-{task}.csv"))
    drawn = save_figures(comparison_figures(summary, comparison, size), folder / "figures")
    for file in (*files, *drawn):
        out.print(str(file))


def _written(rows: list[dict[str, str]], file: Path) -> Path:
    with file.open("w", newline="", encoding="utf-8") as text:
        write = csv.DictWriter(text, rows[0], lineterminator="\n")
        write.writeheader()
        write.writerows(rows)
    return file


def _line(cell: dict[str, Any]) -> str:
    name = f"{cell['task']}, {cell['method']}, seed {cell['seed']}"
    if cell["broke"]:
        return f"{name}: {cell['broke']}"
    last = cell["points"][-1]
    if last is None:
        return f"{name}: no controller within its time"
    J = [np.inf if value is None else value for value in last["J"]]
    return f"{name}: J = {np.median(J):.4g} after {last['spent']:.0f} s of the robot's time"


def _rivals(summary: Any) -> list[dict[str, str]]:
    rows = []
    for method in summary.methods[1:]:
        cells = [cell for task in summary.tasks for cell in summary.of_pair(task, method)]
        if not cells:
            continue
        row = {"method": method, "knows": cells[0]["information"]}
        for at, points in enumerate(summary.checkpoints):
            if points in (30, summary.checkpoints[-1]):
                won, tasks, p = summary.rivalry(method, at)
                row |= {f"no worse on, at {points}": f"{won} of {tasks}", f"p, at {points}": f"{p:.2g}"}
        rows.append(row)
    return rows


def _elsewhere(summary: Any, task: str) -> list[dict[str, str]]:
    names, told = summary.elsewhere(task)
    return [
        {"method": method, "as tuned": f"{np.median(summary.values(task, method, 'J')):.3g}"}
        | {name: f"{value:.3g}" for name, value in zip(names, values, strict=True)}
        for method, values in told.items()
    ]
