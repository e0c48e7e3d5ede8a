"""Linear models: from a probing record, out of a controller, and what they say of the robot at rest."""

import numpy as np

from ...model import StateSpace, identify
from ...mpc import Controller
from ._lab import Lab


def identified(lab: Lab, probing: float) -> StateSpace:
    """The model of the study's family that fits a probing record of so many s best."""
    mpc = lab.study.mpc
    return mpc.model.state_space(identify(mpc.model, lab.probe(probing), seed=lab.study.seed), mpc.sample_time)


def believed(controller: Controller) -> StateSpace:
    """The model that a controller predicts with, without delay and disturbances."""
    design, scale = controller.design, controller.mpc.input_scale
    n = design.order - design.outputs  # behind the model's own states come the disturbances
    return StateSpace(design.A[:n, :n], design.B[:n] / scale, design.C[:, :n], design.D / scale)


def static_gain(model: StateSpace) -> np.ndarray:
    """How outputs at rest depend on inputs that are held (p, m)."""
    A, B, C, D = model
    return C @ np.linalg.solve(np.eye(len(A)) - A, B) + D
