"""Points that fill a cube evenly."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def sobol(dimension: int, log2_count: int, rng: np.random.Generator) -> NDArray:
    """Return the first 2**log2_count points (n, d) of a scrambled Sobol sequence."""
    from scipy.stats import qmc  # half of the time that importing the package would take

    return qmc.Sobol(dimension, rng=rng).random_base2(log2_count)
