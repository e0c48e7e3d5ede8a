"""What the finished runs say: regrets and paired tests."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import rankdata, wilcoxon

from .tune_functions import Problem
from .tune_runs import SEED_POINTS, Run

SIGNIFICANT = 0.05


@dataclass(frozen=True)
class Paired:
    """One search against another on the repetitions that both have run.

    Attributes
    ----------
    pairs
        How many.
    median, others
        Median regrets, of the one and of the other.
    p
        Two-sided, of Wilcoxon's signed-rank test.
    balance
        Signed ranks summed: negative where the one is better.
    """

    pairs: int
    median: float
    others: float
    p: float
    balance: float

    @property
    def second(self) -> bool:
        """Whether the other has the lower median and wins the test as well."""
        return self.others < self.median and self.balance > 0 and self.p < SIGNIFICANT

    def __str__(self) -> str:
        if not self.pairs:
            return "-"
        return f"{'better' if self.balance < 0 else 'worse'} {self.p:.2g}" if self.balance else "equal"


class Table:
    """Regrets of all methods on one problem.

    Where the minimum is not known its place is taken by the lowest cost that any method observed in any repetition,
    also by methods that are left out of the table.
    """

    def __init__(self, problem: Problem, runs: Iterable[Run], evaluations: int, methods: Sequence[str]) -> None:
        self.problem = problem
        self.costs: dict[str, dict[int, np.ndarray]] = {}
        self.seconds: dict[str, list[float]] = {}
        for run in runs:
            if run.problem == problem.name:
                self.costs.setdefault(run.method, {})[run.repetition] = run.curve(evaluations)
                self.seconds.setdefault(run.method, []).append(run.seconds)
        lowest = min((costs.min() for done in self.costs.values() for costs in done.values()), default=np.nan)
        self.least = float(lowest) if problem.least is None else problem.least
        self.costs = {method: done for method, done in self.costs.items() if method in methods}

    def unlike(self) -> list[int]:
        """Repetitions in which methods, told the same seed points, did not see the same: J was another's then."""
        seen: dict[int, list[float]] = {}
        for done in self.costs.values():
            for repetition, costs in done.items():
                seen.setdefault(repetition, []).append(float(costs[SEED_POINTS - 1]))
        return sorted(repetition for repetition, costs in seen.items() if not np.allclose(costs, costs[0], rtol=1e-3))

    def regrets(self, method: str) -> np.ndarray:
        """(repetitions, evaluations)."""
        done = self.costs.get(method, {})
        return (np.array([done[repetition] for repetition in sorted(done)]) - self.least) / self.problem.divisor

    def quartiles(self, method: str) -> np.ndarray:
        """Lower quartile, median and upper quartile of the regret: (3, evaluations)."""
        with np.errstate(invalid="ignore"):  # while runs have nothing but failures, and an infinite regret
            quartiles = np.quantile(self.regrets(method), (0.25, 0.5, 0.75), axis=0)
        return np.nan_to_num(quartiles, nan=np.inf, posinf=np.inf)

    def after(self, method: str, evaluations: int) -> tuple[float, float, float]:
        """Lower quartile, median and upper quartile after so many evaluations."""
        low, median, high = self.quartiles(method)[:, evaluations - 1].tolist()
        return low, median, high

    def against(self, method: str, other: str, evaluations: int) -> Paired:
        """One method beside another after so many evaluations."""
        mine, others = self.costs.get(method, {}), self.costs.get(other, {})
        both = sorted(mine.keys() & others.keys())
        if not both:
            return Paired(0, np.nan, np.nan, np.nan, 0.0)
        a, b = (np.array([costs[k][evaluations - 1] for k in both]) - self.least for costs in (mine, others))
        # Two infinities, nothing but failures, are equal; any finite number is far below one.
        finite = np.minimum(a, 1e300), np.minimum(b, 1e300)
        differences = finite[0] - finite[1]
        p = float(np.asarray(wilcoxon(differences))[1]) if differences.any() else 1.0
        balance = float((np.sign(differences) * rankdata(np.abs(differences))).sum())
        median, median_of_others = (float(np.median(regrets)) / self.problem.divisor for regrets in (a, b))
        return Paired(len(both), median, median_of_others, p, balance)
