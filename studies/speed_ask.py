"""What one ask of the search costs, and how that grows with the trials told.

    python studies/speed_ask.py

Levy's function in 12 dimensions. First a search of 100 trials, point by point, as a campaign asks them; then asks after
as many trials as the table says, told at random points. CPU seconds, linear algebra on one thread; "full" is an ask
that fits the process from all its starts, "mean" is that of 40 asks, most of which start where the last full fit ended.
"""

import os

os.environ.update(dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1"))

import time

import numpy as np

from socasadi.tune import Optimizer, Parameter, Space
from socasadi.tune.surrogate import import_gpy

DIMENSION = 12
SPACE = Space([Parameter(f"x{i}", "", -10.0, 10.0) for i in range(DIMENSION)])
ASKS = 40
TOLD = (50, 100, 150, 200, 300, 500, 1000)


def levy(x: np.ndarray) -> float:
    """Levy's function: many ripples on a bowl, 0 at ones."""
    w = 1 + (x - 1) / 4
    ripples = (w[:-1] - 1) ** 2 * (1 + 10 * np.sin(np.pi * w[:-1] + 1) ** 2)
    end = (w[-1] - 1) ** 2 * (1 + np.sin(2 * np.pi * w[-1]) ** 2)
    return float(np.sin(np.pi * w[0]) ** 2 + ripples.sum() + end)


def asked(search: Optimizer) -> tuple[np.ndarray, float]:
    """The next theta, and the CPU seconds that it took."""
    start = time.process_time()
    theta = search.ask()
    return theta, time.process_time() - start


def main() -> None:
    import_gpy()
    search, spent = Optimizer(SPACE, seed=0), []
    for _ in range(100):
        theta, seconds = asked(search)
        spent.append(seconds)
        search.tell(theta, levy(theta))
    print(f"a search of 100 trials in {DIMENSION} dimensions: {np.mean(spent):.2f} s of CPU a trial on average")
    print(f"its best: {search.best.cost:.2f}" if search.best else "")
    print(f"\n{'told':>6} {'full / s':>10} {'mean / s':>10}")
    random = np.random.default_rng(0)
    for told in TOLD:
        search, spent = Optimizer(SPACE, seed=0), []
        for number in range(1, told + ASKS):
            theta = random.uniform(-10.0, 10.0, DIMENSION)
            search.tell(theta, levy(theta))
            if number >= told:
                spent.append(asked(search)[1])
        print(f"{told:6} {spent[0]:10.2f} {np.mean(spent):10.2f}", flush=True)


if __name__ == "__main__":
    main()
