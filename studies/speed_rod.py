"""How fast the rod is: beside Exudyn, PyElastica and SoRoMoX, by degrees of freedom, and until it is machine code.

    pip install socasadi[peers]
    python studies/speed_rod.py [--no-peers]

The step couple (studies/peers/case.py) in three kinds of model. Each run has a process of its own on one core; the
time is the best of a few repetitions. The error is the largest distance of the tip, of the forty samples up to 2 s, to
the converged answer of the same model by the same program (SoRoMoX: to that of this package, which solves the same
equations).
"""

import argparse
import os
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from peers import Absent, Run, exudyn, measured, pyelastica, soromox
from peers.case import COUPLE, DENSITY, DURATION, LENGTH, RADIUS, SAMPLE, TIMES, VISCOSITY, YOUNG

from socasadi.codegen import Buffered, compiled
from socasadi.rod import Material, PointLoad, Rod, Section, Strain

SIX = {"bending_y": 2, "bending_z": 2, "torsion": 0, "stretch": 0, "shear_y": 0, "shear_z": 0}
BENDING = {"bending_y": 2, "bending_z": 2, "stretch": 0}
FINE, FINEST = {"points": 14, "step": 5e-4}, SAMPLE / 50


@dataclass(frozen=True)
class Kind:
    """One kind of model: our runs, our converged run, and peers with the settings that take them to convergence."""

    name: str
    ours: list[dict[str, Any]]
    converged: dict[str, Any]
    peers: list[tuple[Callable[..., Run], dict[str, Any], dict[str, Any]]]


KINDS = [
    Kind(
        "in three dimensions, with torsion, stretch and shear",
        [{"strain": SIX, "points": 10, "step": 0.025}, {"strain": SIX, "points": 4, "step": 0.025}],
        {"strain": {"bending_z": 7, "stretch": 4, "shear_y": 5}, **FINE},
        [
            (exudyn, {"beam": "spatial", "elements": 12, "step": SAMPLE / 3}, {"elements": 64, "step": FINEST}),
            (pyelastica, {"elements": 20, "step": SAMPLE / 80}, {"elements": 80, "step": SAMPLE / 500}),
            (soromox, {"orders": (0, 2, 2, 0, 0, 0), "solver": "Kvaerno5", "step": 0.01, "rtol": 1e-4}, {}),
        ],
    ),
    Kind(
        "in three dimensions, with stretch alone",
        [{"strain": BENDING, "points": 4, "step": 0.025}],
        {"strain": {"bending_z": 7, "stretch": 4}, **FINE},
        [
            (exudyn, {"beam": "cable", "elements": 2, "step": 0.025}, {"elements": 16, "step": FINEST}),
            (soromox, {"orders": (-1, 2, 2, 0, -1, -1), "step": 1e-3}, {}),
        ],
    ),
    Kind(
        "in the plane, with stretch and shear",
        [{"strain": {"bending_z": 2, "stretch": 0, "shear_y": 0}, "points": 4, "step": 0.025}],
        {"strain": {"bending_z": 7, "stretch": 4, "shear_y": 5}, **FINE},
        [(exudyn, {"beam": "planar", "elements": 2, "step": 0.025}, {"elements": 16, "step": FINEST})],
    ),
]


def rod(strain: dict[str, Any], points: int, **changes: Any) -> Rod:
    material = Material(YOUNG, poisson=0.5, density=DENSITY, damping=VISCOSITY)
    return Rod(LENGTH, Section.circle(RADIUS), material, Strain(**strain), quadrature_points=points, **changes)


def ours(strain: dict[str, Any], points: int, step: float) -> Run:
    """The step couple by this package: one call of machine code for all the samples."""
    begin = time.perf_counter()
    bent = rod(strain, points, loads=(PointLoad(moment=(0, 0, COUPLE)),))
    every_sample = compiled(bent.step_expression(SAMPLE, step).mapaccum(len(TIMES)))
    call, rest = Buffered(every_sample), np.zeros(2 * bent.dof)
    nothing = np.zeros(3 * len(TIMES))
    call(rest, np.zeros(0), nothing)
    setup, walls, states = time.perf_counter() - begin, [], rest
    for _ in range(200):
        begin = time.perf_counter()
        (states,) = call(rest, np.zeros(0), nothing)
        walls.append(time.perf_counter() - begin)
    states = states.reshape(len(TIMES), -1)
    tip = np.array([bent.tip(x[: bent.dof]).full()[:, 0] for x in states])
    name = f"socasadi, {len(strain)} strains, {points} points, {1e3 * step:.3g} ms"
    return Run(name, "bending_y" in strain, bent.dof, TIMES, tip, min(walls), setup)


def beside_peers(with_peers: bool) -> None:
    for kind in KINDS:
        head = f"{'dof':>4} {'error / mm':>10} {'x real time':>11} {'x our time':>10} {'setup / s':>9} {'MB':>5}"
        print(f"\n{kind.name:75} {head}")
        converged = measured(ours, **kind.converged)
        runs = [measured(ours, **settings) for settings in kind.ours]
        fastest = min(run.wall for run in runs if isinstance(run, Run))
        for run in runs:
            show(run, converged, fastest)
        for peer, settings, finest in kind.peers if with_peers else []:
            run = measured(peer, **settings)
            show(run, measured(peer, **settings | finest) if finest else converged, fastest)


def show(run: Run | Absent, converged: Run | Absent, fastest: float) -> None:
    for absent in (run, converged):
        if isinstance(absent, Absent):
            print(f"{absent.name}: {absent.reason}")
            return
    assert isinstance(run, Run)
    assert isinstance(converged, Run)
    error = 1e3 * np.linalg.norm(run.tip - converged.tip, axis=1).max()
    speed = f"{DURATION / run.wall:11.0f} {run.wall / fastest:10.1f}"
    print(f"{run.name:75} {run.dof:4} {error:10.3f} {speed} {run.setup:9.2f} {run.memory:5.0f}", flush=True)


def legendre(dof: int) -> dict[str, Any]:
    """Bending about both axes as far as ``dof`` goes, with constant torsion and stretch."""
    half = (dof - 2) // 2
    return {"bending_y": half - 1, "bending_z": half - 1, "torsion": 0, "stretch": 0}


def right_hand_side(dof: int, points: int) -> float:
    """Wall time of one compiled right-hand side, s."""
    function = compiled(rod(legendre(dof), points).rhs)
    call, random = Buffered(function), np.random.default_rng(0)
    call(0.1 * random.normal(size=2 * dof), np.zeros(0))
    best = np.inf
    for _ in range(20):
        begin = time.perf_counter()
        for _ in range(200):
            call._evaluate()
        best = min(best, (time.perf_counter() - begin) / 200)
    return best


def growth(folder: Path) -> None:
    dofs, counts = (4, 6, 8, 10, 14, 20, 28, 40), (4, 6, 10, 16, 24, 40)
    by_dof = [1e6 * right_hand_side(dof, 20) for dof in dofs]
    by_points = [1e6 * right_hand_side(10, points) for points in counts]
    print("\nright-hand side, us:")
    print(f"  10 coordinates, 10 points: {by_points[2]:.2f}")
    print("  20 points, by coordinates:", ", ".join(f"{n}: {t:.1f}" for n, t in zip(dofs, by_dof, strict=True)))
    print("  10 coordinates, by points:", ", ".join(f"{n}: {t:.1f}" for n, t in zip(counts, by_points, strict=True)))
    slope = [np.polyfit(np.log(x[-4:]), np.log(y[-4:]), 1)[0] for x, y in ((dofs, by_dof), (counts, by_points))]
    print(f"  power over the upper half: {slope[0]:.2f} in coordinates, {slope[1]:.2f} in points")
    figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.6), sharey=True, layout="constrained")
    left.loglog(dofs, by_dof, "o-", label="20 points")
    left.loglog(dofs[3:], [by_dof[3] * (n / dofs[3]) ** 2 for n in dofs[3:]], ":", color="0.5", label="square")
    left.set(xlabel="coordinates n", ylabel="one right-hand side / µs", xticks=dofs, xticklabels=dofs)
    right.loglog(counts, by_points, "o-", label="10 coordinates")
    right.loglog(counts, [by_points[2] * n / counts[2] for n in counts], ":", color="0.5", label="proportional")
    right.set(xlabel="quadrature points", xticks=counts, xticklabels=counts)
    for axes in (left, right):
        axes.minorticks_off()
        axes.grid(alpha=0.3)
        axes.legend(frameon=False, fontsize=8)
    figure.savefig(folder / "rod-growth.png", dpi=150)


def build(dof: int, points: int) -> Run:
    """From a description to a compiled step, in a process of its own; the tip and its times stay empty."""
    begin = time.perf_counter()
    rod(legendre(dof), points).step(SAMPLE, 0.005)
    setup = time.perf_counter() - begin
    return Run("", True, dof, np.empty(0), np.empty(0), np.nan, setup)


def building() -> None:
    print("\nfrom Rod(...) to a compiled step, s (peak memory, the compiler's included, MB):")
    for dof, points in ((10, 10), (24, 16), (40, 24)):
        with tempfile.TemporaryDirectory() as cache:
            os.environ["SOCASADI_CACHE"] = cache
            cold, cached = measured(build, dof=dof, points=points), measured(build, dof=dof, points=points)
        if isinstance(cold, Run) and isinstance(cached, Run):
            print(f"  {dof} coordinates: {cold.setup:.2f} cold ({cold.memory:.0f}), {cached.setup:.2f} from the cache")


def main() -> None:
    parser = argparse.ArgumentParser(description="How fast the rod is.")
    parser.add_argument("--no-peers", action="store_true", help="leave out Exudyn, PyElastica and SoRoMoX")
    with_peers = not parser.parse_args().no_peers
    with tempfile.TemporaryDirectory() as cache:
        os.environ["SOCASADI_CACHE"] = cache
        beside_peers(with_peers)
        growth(Path(__file__).parent / "figures")
    building()


if __name__ == "__main__":
    main()
