"""Functions of which the minimum is known: the usual four, and some that nobody has tuned a search for."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from socasadi.tune import Parameter, Space

Function = Callable[[np.ndarray], float]


@dataclass(frozen=True)
class Problem:
    """Something to minimise.

    Attributes
    ----------
    name, title
        On the command line, and in print.
    space
        The box.
    evaluate
        (theta, repetition, number of the evaluation) -> cost, or None when it failed.
    least
        The lowest cost there is; None when nobody knows.
    truth
        Cost without noise, by which a noisy problem with a known minimum is judged.
    divisor
        By which a regret is divided in print.
    note
        What is to be known about it, in print.
    extra
        Not one of the seven by which searches are compared.
    """

    name: str
    title: str
    space: Space
    evaluate: Callable[[np.ndarray, int, int], float | None]
    least: float | None = None
    truth: Function | None = None
    divisor: float = 1.0
    note: str = ""
    extra: bool = False

    @property
    def tuning(self) -> bool:
        return self.least is None


def hartmann6(x: np.ndarray) -> float:
    scale = np.array([1.0, 1.2, 3.0, 3.2])
    A = np.array(
        [[10, 3, 17, 3.5, 1.7, 8], [0.05, 10, 17, 0.1, 8, 14], [3, 3.5, 1.7, 10, 17, 8], [17, 8, 0.05, 10, 0.1, 14]]
    )
    P = 1e-4 * np.array(
        [
            [1312, 1696, 5569, 124, 8283, 5886],
            [2329, 4135, 8307, 3736, 1004, 9991],
            [2348, 1451, 3522, 2883, 3047, 6650],
            [4047, 8828, 8732, 5743, 1091, 381],
        ]
    )
    return -float(scale @ np.exp(-(A * (x - P) ** 2).sum(axis=1)))


def ackley(x: np.ndarray) -> float:
    wells = np.exp(np.cos(2 * np.pi * x).mean())
    return float(-20 * np.exp(-0.2 * np.sqrt((x**2).mean())) - wells + 20 + np.e)


def rosenbrock(x: np.ndarray) -> float:
    return float((100 * (x[1:] - x[:-1] ** 2) ** 2 + (1 - x[:-1]) ** 2).sum())


def levy(x: np.ndarray) -> float:
    w = 1 + (x - 1) / 4
    inner = (w[:-1] - 1) ** 2 * (1 + 10 * np.sin(np.pi * w[:-1] + 1) ** 2)
    ends = np.sin(np.pi * w[0]) ** 2 + (w[-1] - 1) ** 2 * (1 + np.sin(2 * np.pi * w[-1]) ** 2)
    return float(ends + inner.sum())


def griewank(x: np.ndarray) -> float:
    return float((x**2).sum() / 4000 - np.cos(x / np.sqrt(np.arange(1, len(x) + 1))).prod() + 1)


def styblinski_tang(x: np.ndarray) -> float:
    return float((x**4 - 16 * x**2 + 5 * x).sum() / 2)


def michalewicz(x: np.ndarray) -> float:
    return -float((np.sin(x) * np.sin(np.arange(1, len(x) + 1) * x**2 / np.pi) ** 20).sum())


def branin(x: np.ndarray) -> float:
    bowl = (x[1] - 5.1 * x[0] ** 2 / (4 * np.pi**2) + 5 * x[0] / np.pi - 6) ** 2
    return float(bowl + 10 * (1 - 1 / (8 * np.pi)) * np.cos(x[0]) + 10)


def half_fails(x: np.ndarray) -> float | None:
    """Hartmann's function where x3 + x6 > 1, half of the box; its minimum is at 0.477 + 0.657."""
    return hartmann6(x) if x[2] + x[5] > 1 else None


def box(lower: float, upper: float, dimension: int) -> Space:
    return Space([Parameter(f"x{i + 1}", "", lower, upper) for i in range(dimension)])


def exact(function: Callable[[np.ndarray], float | None]) -> Callable[[np.ndarray, int, int], float | None]:
    return lambda x, repetition, number: function(x)


def noisy(function: Function, deviation: float) -> Callable[[np.ndarray, int, int], float]:
    return lambda x, repetition, number: function(x) + deviation * np.random.default_rng([repetition, number]).normal()


# Somewhere within the middle seven tenths of the box, so that no corner and no symmetry helps.
SHIFT = 32.768 * np.random.default_rng(2210).uniform(-0.7, 0.7, size=10)
CENTRED = "the minimum is at the centre of the box, where a prior of the search may have its own"
HARTMANN6 = -3.32236801141551  # at (.20169, .150011, .476874, .275332, .311652, .6573)

FUNCTIONS = [
    Problem("hartmann6", "Hartmann6", box(0, 1, 6), exact(hartmann6), HARTMANN6),
    Problem("ackley10", "Ackley10", box(-32.768, 32.768, 10), exact(ackley), 0.0, note=CENTRED),
    Problem("rosenbrock10", "Rosenbrock10 / 1e4", box(-5, 10, 10), exact(rosenbrock), 0.0, divisor=1e4),
    Problem("levy12", "Levy12", box(-10, 10, 12), exact(levy), 0.0),
]
EXTRA = [
    Problem(
        "ackley10-shifted",
        "Ackley10, shifted",
        box(-32.768, 32.768, 10),
        exact(lambda x: ackley(x - SHIFT)),
        0.0,
        extra=True,
    ),
    Problem("griewank8", "Griewank8", box(-600, 600, 8), exact(griewank), 0.0, note=CENTRED, extra=True),
    Problem(
        "styblinski-tang8",
        "Styblinski-Tang8",
        box(-5, 5, 8),
        exact(styblinski_tang),
        -39.16616570377142 * 8,
        extra=True,
    ),
    Problem("michalewicz10", "Michalewicz10", box(0, np.pi, 10), exact(michalewicz), -9.66015171564135, extra=True),
    Problem(
        "branin",
        "Branin",
        Space([Parameter("x1", "", -5, 10), Parameter("x2", "", 0, 15)]),
        exact(branin),
        0.397887357729739,
        extra=True,
    ),
    Problem("half-fails", "Hartmann6, half fails", box(0, 1, 6), exact(half_fails), HARTMANN6, extra=True),
    Problem(
        "hartmann6-noisy",
        "Hartmann6, noise 0.1",
        box(0, 1, 6),
        noisy(hartmann6, 0.1),
        HARTMANN6,
        truth=hartmann6,
        extra=True,
    ),
]
