"""The paper, figure by figure: its two scenarios, searched with its own Gaussian process and with this package's.

    python studies/paper.py [--seeds S ...] [--iterations N] [--out DIR] [--page DIR]

The studies are those of origin.py and circle.py. `Study(search="paper")` is the search of Pal, He and Wei (arXiv
2210.08780): zero mean, Gaussian kernel, plain expected improvement, noise variance 0.01^2. Beside it stands the search
of this package and, in the table, as many Sobol points. All start from the same ten seed points, and no trial is cut,
so that they differ in nothing else. Runs are kept in --out (runs/paper): a stopped command goes on when it is given
again. Figures and table go to figures/ and results/paper/ under --page, which is this folder.
"""

import argparse
import csv
import io
import itertools
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from circle import study as circle
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from origin import study as origin
from PIL import Image

from socasadi.campaign import Episode, Progress, Result, Study, assess, print_progress
from socasadi.report import BLACK, BLUE, COLUMN, GREY, MM, SETTINGS, best_so_far, cost_axis, legend_above, page

SCENARIOS = {"origin": origin, "circle": circle}
SEARCHES = {"paper": "the paper's settings", "bayesian": "ours", "sobol": "Sobol points"}
STATED = {
    "origin": "the best at evaluation 42, nearly as good by about 10; its J weighs newtons, and is another",
    "circle": "no number that could stand beside these; its J is another",
}
# Told apart by lightness and dashes as well as by hue.
AMBER = "#E69F00"
LOOKS: dict[str, Any] = {"bayesian": {"color": BLUE, "ls": "-"}, "paper": {"color": AMBER, "ls": (0, (4, 1.5))}}
MARKERS: dict[str, Any] = {
    "bayesian": {"marker": "o", "mfc": BLUE, "mec": BLUE},
    "paper": {"marker": "^", "mfc": "w", "mec": AMBER},
}

Runs = dict[tuple[str, str], list[Result]]


def main() -> None:
    parser = argparse.ArgumentParser(description="Every figure of the paper that shows results, and a table.")
    parser.add_argument("--seeds", type=int, nargs="+", default=[0, 1, 2], help="the first is drawn bold (0 1 2)")
    parser.add_argument("--iterations", type=int, default=100, help="trials after the ten seed points (100)")
    parser.add_argument("--smoke", action="store_true", help="does it work: 2 seed points, 1 iteration, tasks of 6 s")
    parser.add_argument("--out", type=Path, help="folder of the runs (runs/paper, or runs/paper-smoke)")
    parser.add_argument("--page", type=Path, help="folder of figures/ and results/ (studies; of shorter runs, --out)")
    chosen = parser.parse_args()
    out = chosen.out or Path("runs/paper-smoke" if chosen.smoke else "runs/paper")
    target = chosen.page or (out if chosen.smoke or chosen.iterations < 100 else Path(__file__).parent)
    runs: Runs = {}
    rows = []
    for scenario, search, seed in itertools.product(SCENARIOS, SEARCHES, chosen.seeds):
        folder = out / f"{scenario}-{search}-{seed}"
        print(f"{folder.name}:", flush=True)
        study = replace(SCENARIOS[scenario], search=search, seed=seed, iterations=chosen.iterations)
        study = smoke(study) if chosen.smoke else replace(study, verifications=20, give_up=None)
        result = study.run(folder, resume=True, progress=now_and_then)
        runs.setdefault((scenario, search), []).append(result)
        rows.append(judged(scenario, search, result))
    report(rows)
    for file in (*drawn(runs, target / "figures"), stored(rows, target / "results" / "paper" / "table.csv")):
        print(file)


def smoke(study: Study) -> Study:
    task = replace(study.task, duration=6.0)
    return replace(study, task=task, seed_points=2, iterations=1, verifications=1, give_up=None)


def now_and_then(progress: Progress) -> None:
    if progress.done % 10 == 0:
        print_progress(progress)


def judged(scenario: str, search: str, result: Result) -> dict[str, Any]:
    """What a search found and when, what that is worth under fresh noise, and what it took."""
    incumbent = best_so_far(result.trials, result.kept)
    verdicts, study = assess(result).verdicts, result.study
    best, identified = verdicts["best"], verdicts.get("identified")
    costs = np.array([np.inf if trial.J is None else trial.J for trial in result.trials])
    return {
        "scenario": scenario,
        "search": search,
        "seed": study.seed,
        "seed_points_J": incumbent[study.seed_points - 1],
        "best_J": incumbent[-1],
        "best_at": np.nanargmin(incumbent) + 1,
        "near_at": np.argmax(incumbent <= 1.05 * incumbent[-1]) + 1,  # from there on within 5 % of it
        "rmse_mm": 1e3 * result.best.score.rmse if result.best.score else np.nan,
        "verified_J": np.median(best.J),
        "verified_rmse_mm": 1e3 * np.median(best.rmse),
        "identified_J": np.median(identified.J) if identified else np.nan,  # of what fits 20 s of probing best
        "trials": len(result.trials),
        "far": np.sum(costs[study.seed_points :] > 4 * costs.min()),  # not worth a trial: above four times the best
        "std_J": np.std(costs[np.isfinite(costs)]),
        "failed": sum(trial.outcome == "failed" for trial in result.trials),
        "plant_s": result.plant_seconds,
        "wall_s": sum(trial.seconds["trial"] for trial in result.trials),
    }


def cells(rows: Sequence[dict[str, Any]]) -> list[list[str]]:
    """The table in words, its head first."""
    return [list(rows[0]), *[[f"{x:.4g}" if isinstance(x, float) else str(x) for x in row.values()] for row in rows]]


def report(rows: Sequence[dict[str, Any]]) -> None:
    table = cells(rows)
    widths = [max(map(len, column)) for column in zip(*table, strict=True)]
    print()
    for line in table:
        print("  ".join(cell.rjust(width) for cell, width in zip(line, widths, strict=True)))
    for scenario, stated in STATED.items():
        print(f"\n{scenario}: the paper states {stated}")
        verified = {search: [] for search in SEARCHES}
        for row in rows:
            if row["scenario"] == scenario:
                verified[row["search"]].append(row["verified_J"])
        for search in ("bayesian", "sobol"):
            change = 100 * (np.divide(verified[search], verified["paper"]) - 1)
            told = ", ".join(f"{x:+.1f} %" for x in change)
            print(f"verified J of {SEARCHES[search]} against the paper's settings, by seed: {told}")


def stored(rows: Sequence[dict[str, Any]], file: Path) -> Path:
    file.parent.mkdir(parents=True, exist_ok=True)
    with file.open("w", newline="") as text:
        csv.writer(text, lineterminator="\n").writerows(cells(rows))
    return file


def drawn(runs: Runs, folder: Path) -> list[Path]:
    """The paper's four figures, as files."""
    folder.mkdir(parents=True, exist_ok=True)
    of = {scenario: {search: runs[scenario, search] for search in LOOKS} for scenario in SCENARIOS}
    files = []
    with matplotlib.rc_context(SETTINGS):
        figures = {
            "origin-convergence": convergence(of["origin"]),
            "origin-responses": responses(of["origin"]),
            "circle-convergence": convergence(of["circle"]),
            "circle-path": path(of["circle"]),
        }
        for name, figure in figures.items():
            figure.savefig(pixels := io.BytesIO(), dpi=220)
            files.append(folder / f"paper-{name}.png")
            Image.open(pixels).convert("RGB").quantize(48).save(files[-1], optimize=True)
    return files


def convergence(runs: dict[str, list[Result]]) -> Figure:
    """J of each trial of the first seed, and the best so far of all; what is above the scale stands on its edge."""
    figure, (axes,) = page(COLUMN, 66 * MM)
    cost_axis(axes)
    top = 4 * min(best_so_far(first.trials, first.kept)[-1] for first, *_ in runs.values())
    for search, results in runs.items():
        for result in results:
            incumbent = best_so_far(result.trials, result.kept)
            number = np.arange(1, len(incumbent) + 1)
            axes.step(number, incumbent, where="post", **LOOKS[search], **strength(result is results[0], search))
        costs = [top if trial.J is None else min(trial.J, top) for trial in results[0].trials]
        marks: dict[str, Any] = {"ls": "", "clip_on": False, **MARKERS[search]}
        axes.plot(np.arange(1, len(costs) + 1), costs, ms=2.3, mew=0.5, alpha=0.7, **marks)
        (best,) = axes.plot(np.argmin(costs) + 1, min(costs), ms=6, zorder=5, **marks)
        best.set_markeredgecolor(BLACK)
        axes.axvline(results[0].study.seed_points + 0.5, color=GREY, lw=0.6, ls=":")
        axes.set_xlim(0, len(costs) + 2)
    axes.set_yticks([5, 6, 7, 8, 10, 15, 20, 30])
    axes.set_ylim(top / 4.4, top)
    legend_above(axes, 2)
    return figure


def responses(runs: dict[str, list[Result]]) -> Figure:
    """The true tip over time in the best trials; within, the first 3 s."""
    figure, rows = page(COLUMN, 90 * MM, 2)
    for i, axes in enumerate(rows):
        first = axes.inset_axes(((0.32, 0.16, 0.66, 0.4), (0.32, 0.36, 0.66, 0.6))[i])
        first.set_in_layout(False)
        for place in (axes, first):
            place.axhline(0, color=GREY, lw=0.6)
            flights(place, runs, lambda episode, i=i: (episode.time, 1e3 * episode.truth[:, i]))
            place.margins(x=0)
        first.set(xlim=(0, 3), xticks=range(4))
        axes.set_ylabel(f"$x_{i + 1}$ = {'yz'[i]} / mm")
        for axis in (axes.xaxis, axes.yaxis):
            axis.set_major_locator(MaxNLocator(5, steps=[1, 2, 4, 5, 10]))
    rows[-1].set_xlabel("time / s")
    legend_above(rows[0], 2)
    return figure


def path(runs: dict[str, list[Result]]) -> Figure:
    """The true tip's way in the plane in the best trials, and below, how far it is from its reference."""
    figure = Figure(figsize=(COLUMN, 116 * MM))
    plane, off = figure.subplots(2, 1, height_ratios=(3.4, 1))
    wanted = 1e3 * runs["paper"][0].episode(1).reference
    plane.plot(*wanted.T, color="#CCCCCC", lw=3, label="reference", zorder=0)
    plane.plot(0, 0, "s", color=BLACK, ms=3, label="start")
    flights(plane, runs, lambda episode: 1e3 * episode.truth.T)
    plane.set(xlabel="$x_1$ = y / mm", ylabel="$x_2$ = z / mm", aspect="equal")
    flights(off, runs, lambda episode: (episode.time, 1e3 * np.linalg.norm(episode.truth - episode.reference, axis=1)))
    off.set(xlabel="time / s", ylabel="distance / mm", ylim=(0, 4))
    off.xaxis.set_major_locator(MaxNLocator(5))
    off.margins(x=0)
    legend_above(plane, 2)
    return figure


def flights(axes: Axes, runs: dict[str, list[Result]], curve: Callable[[Episode], Iterable[np.ndarray]]) -> None:
    """A curve of each best trial's episode."""
    for search, results in runs.items():
        for result in results:
            episode = result.episode(result.best.number)
            axes.plot(*curve(episode), **LOOKS[search], **strength(result is results[0], search))


def strength(bold: bool, search: str) -> dict[str, Any]:
    return {"lw": 1.2, "zorder": 4, "label": SEARCHES[search]} if bold else {"lw": 0.7, "zorder": 3, "alpha": 0.55}


if __name__ == "__main__":
    main()
