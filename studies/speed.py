"""Where the time of the default circle study goes.

    python studies/speed.py [--iterations N]

Runs `socasadi run studies/circle.py` into a scratch folder, as a user would, and prints the wall time of the whole,
its peak memory, and what the search's trials spent it on.
"""

import argparse
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from socasadi.campaign import Result

PARTS = {
    "fit": "Gaussian process, hyperparameters",
    "acquisition": "acquisition, its maximum",
    "design": "controller from theta",
    "controller": "MPC, 400 samples",
    "plant": "rod, 400 samples",
}


def main() -> None:
    parser = argparse.ArgumentParser(description="Where the time of the default circle study goes.")
    parser.add_argument("--iterations", type=int, default=100)
    iterations = parser.parse_args().iterations
    study = Path(__file__).with_name("circle.py")
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch) / "run"
        command = [sys.executable, "-m", "socasadi.cli", "run", str(study), "--out", str(folder)]
        start = time.perf_counter()
        subprocess.run([*command, "--iterations", str(iterations)], check=True, stdout=subprocess.DEVNULL)
        wall = time.perf_counter() - start
        memory = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024
        result = Result.open(folder)
        for line in report(result, wall, memory):
            print(line)


def report(result: Result, wall: float, memory: float) -> list[str]:
    seconds = [trial.seconds for trial in result.trials]
    total = sum(entry["trial"] for entry in seconds)
    lines = [
        f"socasadi run, {len(seconds)} trials, with Sobol baseline, verification, figures and C: {wall:.1f} s wall",
        f"peak memory {memory:.0f} MB",
        f"trials of the search {total:.1f} s, of which:",
        f"{'':37} {'total / s':>10} {'median / ms':>12} {'max / ms':>10}",
    ]
    rest = total
    for part, title in PARTS.items():
        spent = np.array([entry[part] for entry in seconds if part in entry])
        rest -= spent.sum()
        lines.append(f"  {title:35} {spent.sum():10.2f} {1e3 * np.median(spent):12.2f} {1e3 * spent.max():10.1f}")
    lines.append(f"  {'shapes, scoring, journal':35} {rest:10.2f}")
    return lines


if __name__ == "__main__":
    main()
