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
    from .baselines import Summary, fitting_cells, load_comparison, run_comparison, stored_cells, summary_table
    from .report import comparison_figures, save_figures  # matplotlib takes its time

    if smoke and quick:
        raise RunError("--smoke and --quick are two sizes: give one")
    if jobs is not None and jobs < 1:
        raise RunError(f"--jobs is at least 1, not {jobs}")
    size = "smoke" if smoke else "quick" if quick else "full"
    parts = {"tasks": tasks or (), "methods": methods or (), "seeds": seeds}
    full = load_comparison(script)
    whole = full.of_size(size)
    folder = folder or Path("runs") / f"{script.stem}-{size}"
    part = whole.of_parts(**parts)
    out.print(f"{script}, {size}: {part.extent} for each method, into {folder}")
    there = sum(not cell["broke"] for cell in fitting_cells(part, folder))
    known = {whole.digest(*names) for names in whole.cells}
    strange = sum(cell["digest"] not in known for cell in stored_cells(folder))
    if there or strange:
        others = f"; {strange} that were flown under other settings are left aside" if strange else ""
        out.print(f"{there} of {len(part.cells)} cells are there{others}")
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
            run_comparison(script, size, folder, executor, told, **parts)
    except KeyboardInterrupt:
        out.print("\nStopped. Every finished cell is stored; the same command goes on.")
        raise typer.Exit(130) from None
    # A part that was flown by itself does not take the others out of the tables.
    cells = fitting_cells(whole, folder)
    flown = {cell[kind] for cell in cells for kind in ("task", "method")}
    summary = Summary.of(cells, *([name for name in names if name in flown] for names in (whole.tasks, whole.methods)))
    rows = summary_table(summary)
    hidden = ("task", "knows", "seeds", "p99 / us", "while tuned", "broke")  # which the file has
    for task in summary.tasks:
        shown = [{k: v for k, v in row.items() if k not in hidden} for row in rows if row["task"] == task]
        title = f"\n{task}, after {summary.checkpoints[-1]} episodes' worth of the robot's time:"
        out.print(table(shown, left=("method",), title=title))
    files = [_written(size, rows, folder / "table.csv")]
    if rivals := _rivals(summary):
        title = f"\n{summary.methods[0]} against, in J; how much higher theirs is, median and quartiles over seeds:"
        out.print(table(rivals, left=("method", "knows"), title=title))
        files.append(_written(size, rivals, folder / "against.csv"))
    for task in (task for task in whole.elsewhere_on if task in summary.tasks):
        if not (others := _elsewhere(summary, task)):
            continue  # no method had a controller to fly there
        out.print(table(others, left=("method",), title=f"\n{task}, J on other robots:"))
        files.append(_written(size, others, folder / f"elsewhere-{task}.csv"))
    drawn = save_figures(comparison_figures(summary, full, size), folder / "figures")
    for file in (*files, *drawn):
        out.print(str(file))
    for old in (folder / "against.csv", *folder.glob("elsewhere-*.csv"), *folder.glob("figures/elsewhere*.p[dn][fg]")):
        if old not in (*files, *drawn):  # of the comparison as it was
            old.unlink(missing_ok=True)
    cells = fitting_cells(part, folder)
    for cell in cells:
        if cell["broke"]:
            out.print(f"broke off: {_line(cell)}")
        elif cell["lacking"]:
            out.print(_line(cell))
        elif why := next((point["failure"] for point in cell["points"] if point and point["failure"]), None):
            out.print(f"failed: {cell['task']}, {cell['method']}, seed {cell['seed']}: {why}")
        elif missed := sum(point["fallbacks"] for point in cell["points"][-1:] if point):
            out.print(f"no answer of its own in {missed} samples: {_line(cell)}")
    if any(cell["broke"] for cell in cells):
        raise typer.Exit(1)


def _written(size: str, rows: list[dict[str, str]], file: Path) -> Path:
    with file.open("w", newline="", encoding="utf-8") as text:
        write = csv.DictWriter(text, ["size", *rows[0]], lineterminator="\n")
        write.writeheader()
        write.writerows({"size": size, **row} for row in rows)
    return file


def _line(cell: dict[str, Any]) -> str:
    name = f"{cell['task']}, {cell['method']}, seed {cell['seed']}"
    if cell["broke"]:
        return f"{name}: {cell['broke']}"
    last = cell["points"][-1]
    if last is None:
        return f"{name}: no controller within its time: {cell['lacking']}"
    J = [np.inf if value is None else value for value in last["J"]]
    return f"{name}: J = {np.median(J):.4g} after {last['spent']:.0f} s of the robot's time"


def _rivals(summary: Any) -> list[dict[str, str]]:
    rows: dict[str, dict[str, str]] = {}
    for at, points in enumerate(summary.checkpoints):
        if points not in (30, summary.checkpoints[-1]):
            continue
        for method, rivalry in summary.rivalries(at).items():
            knows = next(c["information"] for task in summary.tasks for c in summary.of_pair(task, method))
            low, middle, high = (f"{100 * share:+.1f}" if share < 10 else "far" for share in rivalry.excess)
            higher = "-" if np.isnan(rivalry.excess[1]) else f"{middle} ({low} to {high})"
            rows.setdefault(method, {"method": method, "knows": knows})
            rows[method] |= {
                f"{summary.methods[0]} at or below, at {points}": f"{rivalry.won} of {rivalry.tasks}",
                f"higher by %, at {points}": higher,
                f"p, at {points}": f"{rivalry.p:.2g}" if np.isfinite(rivalry.p) else "-",
            }
    return list(rows.values())


def _elsewhere(summary: Any, task: str) -> list[dict[str, str]]:
    names, told = summary.elsewhere(task)
    return [
        {"method": method, "as tuned": f"{np.median(summary.values(task, method, 'J')):.3g}"}
        | {name: f"{value:.3g}" for name, value in zip(names, values, strict=True)}
        for method, values in told.items()
    ]
