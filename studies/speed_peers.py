"""Exudyn, PyElastica and SoRoMoX on the step couple, each from coarse to fine.

    pip install socasadi[peers]
    python studies/speed_peers.py [--only NAME]

The error of a run is against the last, finest line of its family: at 2 s, and the largest of the forty samples. The
converged answers of the families lie within 0.11 mm, not closer, because not every one can be told the whole case:
see the modules in studies/peers. SoRoMoX takes minutes, nearly all of it compilation.
"""

import argparse
from collections.abc import Callable
from typing import Any

import numpy as np
from peers import Absent, Run, exudyn, measured, pyelastica, soromox
from peers.case import DURATION, SAMPLE

Case = tuple[Callable[..., Run], dict[str, Any]]
FULL, FINEST = (0, 2, 2, 0, 0, 0), (2, 2, 2, 2, 2, 2)
FAMILIES: list[list[Case]] = [
    [(exudyn, {"beam": "planar", "elements": n, "step": SAMPLE / k}) for n, k in ((2, 2), (3, 3), (4, 5), (16, 50))],
    [(exudyn, {"beam": "cable", "elements": n, "step": SAMPLE / k}) for n, k in ((2, 2), (3, 3), (4, 5), (16, 50))],
    [(exudyn, {"beam": "spatial", "elements": n, "step": SAMPLE / k}) for n, k in ((8, 2), (12, 3), (16, 5), (32, 50))],
    [(pyelastica, {"elements": n, "step": SAMPLE / k}) for n, k in ((11, 50), (16, 64), (20, 80), (80, 500))],
    [(pyelastica, {"elements": n, "step": SAMPLE / k, "damping": "linear"}) for n, k in ((20, 80), (80, 500))],
    [(soromox, {"step": 2.5e-3}), (soromox, {"step": 1e-3}), (soromox, {"solver": "Bosh3", "step": 2e-3})],
    [
        (soromox, {"orders": orders, "solver": "Kvaerno5", "step": 1e-2, "rtol": tolerance})
        for orders, tolerance in ((FULL, 1e-3), (FULL, 1e-4), (FINEST, 1e-5))
    ],
]


def main() -> None:
    parser = argparse.ArgumentParser(description="The step couple by Exudyn, PyElastica and SoRoMoX.")
    parser.add_argument("--only", choices=("exudyn", "pyelastica", "soromox"))
    only = parser.parse_args().only
    head = f"{'':78} {'dof':>4} {'tip at 2 s / mm':>25} {'error / mm':>10} {'largest':>8}"
    print(f"{head} {'s per s':>9} {'x real time':>11} {'setup / s':>9} {'MB':>5}")
    for family in FAMILIES:
        if only and family[0][0].__name__ != only:
            continue
        runs = [measured(peer, **settings) for peer, settings in family]
        finest = runs[-1]
        for run in runs:
            if isinstance(run, Absent) or isinstance(finest, Absent):
                print(f"{run.name}: {run.reason}" if isinstance(run, Absent) else run)
                continue
            error = 1e3 * np.linalg.norm(run.tip - finest.tip, axis=1)
            tip = " ".join(f"{1e3 * value:8.3f}" for value in run.tip[-1])
            name, rate = f"{run.name}{'' if run.spatial else ' (2-D)'}", run.wall / DURATION
            line = f"{name:78} {run.dof:4} {tip:>26} {error[-1]:9.3f} {error.max():8.3f} {rate:9.5f} {1 / rate:11.0f}"
            print(f"{line} {run.setup:9.3f} {run.memory:5.0f}", flush=True)


if __name__ == "__main__":
    main()
