"""One search on one problem, and the folder in which finished ones are kept."""

import json
import os
import time
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from scipy.stats import qmc

from socasadi.tune import Space

from .tune_functions import Problem
from .tune_search import Method

SEED_POINTS = 10


@dataclass(frozen=True)
class Run:
    """A finished search.

    Attributes
    ----------
    problem, method, repetition
        Which.
    evaluations
        How many, with the seed points.
    best
        Each evaluation that was better than all before it, counted from 1, with its cost (of a problem with a known
        truth: the truth of that point).
    seconds
        CPU time of an ask and its tell, s, the mean of those after the seed points.
    failures
        Evaluations that failed.
    theta
        That of the lowest cost.
    versions
        Of the packages at work.
    """

    problem: str
    method: str
    repetition: int
    evaluations: int
    best: list[tuple[int, float]]
    seconds: float
    failures: int
    theta: list[float]
    versions: dict[str, str]

    @property
    def key(self) -> tuple[str, str, int]:
        return self.problem, self.method, self.repetition

    def curve(self, evaluations: int) -> np.ndarray:
        """The best cost after 1, 2, ... evaluations; infinity while all have failed."""
        curve = np.full(evaluations, np.inf)
        for number, cost in self.best:
            curve[number - 1 :] = cost
        return curve


def search(problem: Problem, method: Method, repetition: int, evaluations: int) -> Run:
    """Tell the repetition's seed points, then ask; the clock counts what the search does, not what it minimises.

    A failure comes with the worst cost seen so far, for those who have no notion of one. Failures before the first
    cost wait for it, and seed points go on until there is one.
    """
    space, told = problem.space, 0
    seeds = seed_points(space, repetition, evaluations)
    optimiser = method.make(space, repetition, evaluations)
    waiting: list[np.ndarray] = []
    lowest, worst, theta, failures = np.inf, -np.inf, np.zeros(0), 0
    best, seconds = [], []
    for number in range(evaluations):
        begin = time.process_time()
        asked = number >= SEED_POINTS and told > 0
        unit = np.clip(optimiser.ask(), 0.0, 1.0) if asked else seeds[number]
        spent = time.process_time() - begin
        at = space.from_unit(unit)
        cost = problem.evaluate(at, repetition, number)
        if cost is None:
            failures += 1
            waiting.append(unit)
        else:
            worst = max(worst, cost)
            if cost < lowest:
                lowest, theta = cost, at
                judged = cost if problem.truth is None else problem.truth(at)
                best.append((number + 1, short(judged)))
        begin = time.process_time()
        if np.isfinite(worst):
            for point in waiting:
                optimiser.tell(point, scaled(worst, method), True)
            told, waiting = told + len(waiting), []
        if cost is not None:
            optimiser.tell(unit, scaled(cost, method), False)
            told += 1
        if asked:
            seconds.append(spent + time.process_time() - begin)
    return Run(
        problem=problem.name,
        method=method.name,
        repetition=repetition,
        evaluations=evaluations,
        best=best,
        seconds=round(float(np.mean(seconds)), 4) if seconds else 0.0,
        failures=failures,
        theta=[short(value) for value in theta.tolist()],
        versions=method.versions,
    )


def short(value: float) -> float:
    """To ten digits: files of runs are kept with the studies."""
    return float(f"{value:.10g}")


def scaled(cost: float, method: Method) -> float:
    return float(np.log(cost)) if method.log else cost


def seed_points(space: Space, repetition: int, count: int) -> np.ndarray:
    """Points (count, d) of the unit cube, the same for all searches: a Sobol sequence scrambled by the repetition."""
    sequence = qmc.Sobol(space.dimension, rng=np.random.default_rng(repetition))
    return sequence.random_base2(max(SEED_POINTS, count).bit_length())[:count]


class Results:
    """A folder with a file for each method, a line of JSON for each finished run.

    Files of two folders are merged by writing one behind the other. Delete a method's file when the method has changed.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def add(self, run: Run) -> None:
        """Append, in one write, so that several commands may fill one folder."""
        self.folder.mkdir(parents=True, exist_ok=True)
        line = (json.dumps(asdict(run)) + "\n").encode()
        file = os.open(self.folder / f"{run.method}.jsonl", os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o644)
        try:
            os.write(file, line)
        finally:
            os.close(file)

    def __iter__(self) -> Iterator[Run]:
        for path in sorted(self.folder.glob("*.jsonl")):
            for number, line in enumerate(path.read_text().splitlines(), start=1):
                try:
                    yield Run(**json.loads(line))
                except (ValueError, TypeError) as error:
                    raise SystemExit(f"{path}, line {number}, is no result: {error}; delete the line") from None

    def finished(self, evaluations: int) -> dict[tuple[str, str, int], Run]:
        """The runs of at least so many evaluations, by problem, method and repetition."""
        longest_last = sorted(self, key=lambda run: run.evaluations)
        return {run.key: run for run in longest_last if run.evaluations >= evaluations}
