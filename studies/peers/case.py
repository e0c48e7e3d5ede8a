"""The step couple, and what a run of it gives.

A clamped rod along +x, L = 0.6 m, r = 0.03 m, E = 1e6 Pa, nu = 0.5, rho = 1000 kg/m3, Kelvin-Voigt damping of
1.1e4 Pa s with the sectional matrix diag(Ix, 3 Iy, 3 Iz, 3 A, A, A), no gravity. At t = 0 a couple of 0.1 N m about z
takes hold of the tip; the answer is the tip every 50 ms up to 2 s.
"""

import os
import resource
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from multiprocessing import get_context
from typing import Any

import numpy as np

LENGTH, RADIUS, YOUNG, DENSITY, VISCOSITY, COUPLE, DURATION = 0.6, 0.03, 1e6, 1000.0, 1.1e4, 0.1, 2.0
AREA, INERTIA, POLAR = np.pi * RADIUS**2, np.pi * RADIUS**4 / 4, np.pi * RADIUS**4 / 2
EA, EI, GA, GJ = YOUNG * AREA, YOUNG * INERTIA, YOUNG / 3 * AREA, YOUNG / 3 * POLAR
VEA, VEI, VGA, VGJ = 3 * VISCOSITY * AREA, 3 * VISCOSITY * INERTIA, VISCOSITY * AREA, VISCOSITY * POLAR
SAMPLE = 0.05
TIMES = SAMPLE * np.arange(1, round(DURATION / SAMPLE) + 1)


@dataclass(frozen=True)
class Run:
    """One simulation of the step couple: `tip` (k, 3) in m at `times` (k,) in s, `wall` and `setup` in s of wall time.

    `wall` is the best of a few repetitions of the simulation alone, `setup` building the model and compiling it;
    `memory` is the peak of the process and of the largest that it started (a compiler, say) in MB, known only through
    `measured`.
    """

    name: str
    spatial: bool
    dof: int
    times: np.ndarray
    tip: np.ndarray
    wall: float
    setup: float
    memory: float = float("nan")


@dataclass(frozen=True)
class Absent:
    """A peer that could not run, and why."""

    name: str
    reason: str


def measured(peer: Callable[..., Run], **settings: Any) -> Run | Absent:
    """`peer(**settings)` in a fresh process on one processor, with that process's peak memory."""
    with ProcessPoolExecutor(max_workers=1, mp_context=get_context("spawn")) as pool:
        return pool.submit(_alone, peer, settings).result()


def _alone(peer: Callable[..., Run], settings: dict[str, Any]) -> Run | Absent:
    os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})
    try:
        run = peer(**settings)
    except ModuleNotFoundError as missing:
        return Absent(peer.__name__, f"not installed ({missing.name} is missing): pip install socasadi[peers]")
    except Exception as error:  # their exceptions do not always survive the way between processes
        return Absent(peer.__name__, f"failed with {settings}: {type(error).__name__}: {str(error)[:200]}")
    peaks = [resource.getrusage(who).ru_maxrss for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return replace(run, memory=sum(peaks) / 1024)


def steps_a_sample(step: float) -> int:
    steps = round(SAMPLE / step)
    if steps < 1 or abs(steps * step - SAMPLE) > 1e-9:
        raise ValueError(f"a step must divide the sample of {SAMPLE} s, {step} does not: take 0.05 / k")
    return steps
