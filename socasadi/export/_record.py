from dataclasses import dataclass, field

import numpy as np

from ..model import StateSpace
from ..mpc import LinearMPC


@dataclass(frozen=True, eq=False)
class ControllerRecord:
    """A controller as plain data, with the episode it is checked on and where it comes from.

    Parameters
    ----------
    mpc
        Its specification.
    system
        Its prediction model.
    output
        (T, p) m, measured at samples 0 ... T - 1 of an episode.
    preview
        (T, horizon, p) m, what was wanted from each of these samples on.
    held
        (m,) N, tensions before the first sample.
    provenance
        Lines that go into the exported header: theta, cost, versions.
    """

    mpc: LinearMPC
    system: StateSpace
    output: np.ndarray
    preview: np.ndarray
    held: np.ndarray
    provenance: tuple[str, ...] = field(default=())

    def __post_init__(self) -> None:
        T, p, N = len(self.output), self.mpc.outputs, self.mpc.horizon
        shapes = {"output": (T, p), "preview": (T, N, p), "held": (self.mpc.inputs,)}
        for name, shape in shapes.items():
            if getattr(self, name).shape != shape:
                raise ValueError(f"{name} of the recorded episode has shape {getattr(self, name).shape}, not {shape}")
        if not T:
            raise ValueError("the recorded episode is empty: there is nothing to check the controller on")
