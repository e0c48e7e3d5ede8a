"""What it spares the robot, and what it costs the search, to cut trials that are proven hopeless.

    python studies/speed_cut.py [--seeds N] [--iterations N]

The study unknown_arm.py, with `give_up` at several multiples of the best J and without it. J is the median of five
flights under fresh noise of the controller that would be exported; plant time is the robot's, of all trials.
"""

import argparse
import sys
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

from socasadi.campaign import assess, assessed, load_study

SHARES = (None, 10.0, 3.0, 1.5)


def main() -> None:
    parser = argparse.ArgumentParser(description="What cutting hopeless trials spares, and what it costs.")
    parser.add_argument("--seeds", type=int, default=5, help="how many searches of each (5)")
    parser.add_argument("--iterations", type=int, default=50, help="trials after the ten seed points (50)")
    chosen = parser.parse_args()
    study = replace(load_study(Path(__file__).with_name("unknown_arm.py")), iterations=chosen.iterations)
    print(f"unknown_arm.py, {study.trials} trials of {study.task.duration:g} s, seeds 0 to {chosen.seeds - 1}")
    print(f"{'cut at':>14} {'J, by seed':>40} {'median J':>9} {'plant time / min':>17} {'spared / min':>13}")
    for share in SHARES:
        costs, flown, spared = [], 0.0, 0.0
        for seed in range(chosen.seeds):
            with tempfile.TemporaryDirectory() as folder:
                result = replace(study, seed=seed, give_up=share).run(Path(folder) / "run", progress=None)
                assess(result)
                verdicts = assessed(result).values()
                theta = result.chosen.theta
                costs += [np.median(one.J) for one in verdicts if np.array_equal(one.theta, theta)][:1]
                flown, spared = flown + result.plant_seconds, spared + result.saved_seconds
            print(f"seed {seed} done", file=sys.stderr)
        name = "never" if share is None else f"{share:g} x the best"
        by_seed = " ".join(f"{cost:.2f}" for cost in costs)
        minutes = (f"{seconds / chosen.seeds / 60:.1f}" for seconds in (flown, spared))
        print("{:>14} {:>40} {:9.2f} {:>17} {:>13}".format(name, by_seed, np.median(costs), *minutes), flush=True)


if __name__ == "__main__":
    main()
