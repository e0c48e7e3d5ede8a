from typing import TYPE_CHECKING

import numpy as np

from ..formulation import Design
from ._loop import closed_loop, prediction_model

if TYPE_CHECKING:
    from .._spec import LinearMPC


def loop_radius(mpc: "LinearMPC", design: Design, factor: float = 1.0) -> float:
    """Spectral radius of the loop around ``factor`` times the prediction model, while no bound is active.

    One number of :func:`analyse` in a hundredth of its time, for where thousands of models are gone through.
    """
    loop = closed_loop(mpc, design, prediction_model(mpc, design), factor)
    return float(np.abs(np.linalg.eigvals(loop.A)).max())
