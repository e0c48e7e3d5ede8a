"""From told trials to the numbers that the Gaussian process sees: transform, failures, standardisation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ._search import Trial
from ._transform import Transform

# A failure counts as the worst cost seen plus this part of the range seen, on the transformed scale. Larger
# margins make a cliff that the model spends its lengthscales on.
FAILURE_MARGIN = 0.1


@dataclass(frozen=True, eq=False)
class Targets:
    """Standardised targets of all trials, in their order.

    `values` (n,) = (transformed cost - location) / scale; `best` is the lowest among trials that did not
    fail.
    """

    values: NDArray
    best: float
    location: float
    scale: float


def targets(trials: Sequence[Trial], transform: Transform) -> Targets:
    """Transform the costs, put "worst seen plus a margin" for failures, standardise.

    The imputation is that of Vizier's infeasible trials (Song et al. 2024, arXiv 2408.11527): it is relative
    to what was seen, so the surrogate stays smooth where an arbitrary large number would be a spike. At least
    one trial must have a cost.
    """
    failed = np.array([trial.failed for trial in trials])
    seen = transform.apply(np.array([trial.cost for trial in trials if trial.cost is not None]))
    values = np.empty(len(trials))
    values[~failed] = seen
    spread = float(np.ptp(seen))
    # Without any spread every positive margin says the same after standardisation.
    values[failed] = seen.max() + (FAILURE_MARGIN * spread if spread > 0 else 1.0)
    location, scale = float(values.mean()), float(values.std())
    if scale <= 1e-12 * max(1.0, abs(location)):
        scale = 1.0
    values = (values - location) / scale
    return Targets(values, float(values[~failed].min()), location, scale)
