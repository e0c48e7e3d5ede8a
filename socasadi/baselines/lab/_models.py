"""A linear model from a probing record, and what it says of the robot at rest."""

import numpy as np

from ...model import StateSpace, identify
from ._lab import Lab


def identified(lab: Lab, probing: float) -> StateSpace:
    """The model of the study's family that fits a probing record of so many s best."""
    mpc = lab.study.mpc
    return mpc.model.state_space(identify(mpc.model, lab.probe(probing), seed=lab.study.seed), mpc.sample_time)


def static_gain(model: StateSpace) -> np.ndarray:
    """How outputs at rest depend on inputs that are held (p, m)."""
    A, B, C, D = model
    return C @ np.linalg.solve(np.eye(len(A)) - A, B) + D
