"""Problems with known minima, and what drives a search over them."""

from collections.abc import Callable

import numpy as np

from socasadi.tune import Parameter, Search, Space

BRANIN = Space([Parameter("x", "", -5, 10), Parameter("y", "", 0, 15)])
BRANIN_MINIMUM = 0.397887  # Dixon and Szego 1978


def branin(theta):
    x, y = theta
    curve = y - 5.1 / (4 * np.pi**2) * x**2 + 5 / np.pi * x - 6
    return float(curve**2 + 10 * (1 - 1 / (8 * np.pi)) * np.cos(x) + 10)


def cube(d: int) -> Space:
    return Space([Parameter(f"x{i}", "", 0.0, 1.0) for i in range(d)])


def sphere(theta):
    """0.1 at (0.3, 0.3, ...), where it is least."""
    return 0.1 + float(np.sum((np.asarray(theta) - 0.3) ** 2))


def run(search: Search, cost: Callable, trials: int, fails: Callable = lambda theta: False):
    for _ in range(trials):
        theta = search.ask()
        if fails(theta):
            search.tell(theta, failed=True)
        else:
            search.tell(theta, cost(theta))
    return search


def told(search: Search) -> np.ndarray:
    """The thetas told, (n, d)."""
    return np.array([trial.theta for trial in search.trials])


def nearest(points: np.ndarray) -> float:
    """The least distance between any two points, in the coordinate in which they differ most."""
    apart = np.abs(points[:, None] - points[None]).max(axis=2)
    return float(apart[np.triu_indices(len(points), 1)].min())


def repeats(points: np.ndarray, within: float = 1e-9) -> int:
    """How many points stand at the place of an earlier one."""
    apart = np.abs(points[:, None] - points[None]).max(axis=2)
    return sum(bool((apart[i, :i] < within).any()) for i in range(len(points)))


def differences(function: Callable, x: np.ndarray, step: float = 1e-5) -> np.ndarray:
    """The gradient (d,) by central differences of the fourth order."""
    gradient = np.zeros(len(x))
    for i, h in enumerate(step * np.eye(len(x))):
        gradient[i] = (8 * (function(x + h) - function(x - h)) - function(x + 2 * h) + function(x - 2 * h)) / (
            12 * step
        )
    return gradient
