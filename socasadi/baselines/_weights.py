from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from ..campaign import Pilot
from ..model import Entry
from ._lab import Lab
from ._method import Method, identified, tuned


@dataclass(frozen=True)
class Weights(Method):
    """The model is identified once, and the MPC's weights and its observer are tuned by flights.

    Neumann-Brosig, Marco, Schwarzmann, Trimpe, "Data-efficient autotuning with Bayesian optimization: an industrial
    control study", IEEE Trans. Control Systems Technology 28(3), 2020 (arXiv 1812.06325). Open are R (of Q and R only
    the quotient matters), and what the observer assumes of unknown inputs and of the disturbance, against its sensor's
    noise; each within two decades of what the study has.

    Parameters
    ----------
    probing
        s of probing.
    """

    probing: float = 20.0

    def offers(self, lab: Lab) -> Iterator[Pilot]:
        mpc, model = lab.study.mpc, identified(lab, self.probing)
        names = ("R", "input_noise", "disturbance_noise")
        given = {name: np.asarray(getattr(mpc, name), dtype=float) for name in names}

        def build(factors: np.ndarray) -> Pilot:
            changed = {name: factor * given[name] for name, factor in zip(names, factors, strict=True)}
            return replace(mpc, **changed).controller_for(model)

        knobs = [Entry(f"factor on {name}", "1", 0.01, 100.0, "log") for name in names]
        return tuned(lab, knobs, build, initial=[np.ones(len(names))])
