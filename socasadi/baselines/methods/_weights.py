from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Literal

from ...campaign import Pilot
from ...model import Fixed, subspace
from ...plant import Plant
from ..lab import Lab, Method, identified, tuned


@dataclass(frozen=True)
class WeightSearch(Method):
    """A model is identified once, and what the study's MPC assumes and weighs is tuned by flights.

    Neumann-Brosig, Marco, Schwarzmann, Trimpe, "Data-efficient autotuning with Bayesian optimization: an industrial
    control study", IEEE Trans. Control Systems Technology 28(3), 2020 (arXiv 1812.06325), for an MPC.

    Parameters
    ----------
    model
        ``"family"``, the member of the study's family that predicts a probing record best; ``"subspace"``, see
        :func:`socasadi.model.subspace`.
    probing
        s of probing.
    tuned
        Settings that theta holds, each within two decades, as of :class:`LinearMPC`. Of Q and R only the quotient
        matters, and of the sensor's noise and the others.
    over, by
        Other robots on which every controller is flown beside the study's, and whether the mean or the worst J counts:
        a search for robustness, whose flights cost as many times the robot's time.
    """

    model: Literal["family", "subspace"] = "family"
    probing: float = 20.0
    tuned: tuple[str, ...] = ("R", "input_noise", "disturbance_noise")
    over: tuple[Callable[[Plant], Plant], ...] = ()
    by: Literal["mean", "worst"] = "mean"

    def offers(self, lab: Lab) -> Iterator[Pilot]:
        mpc = lab.study.mpc
        found = identified(lab, self.probing) if self.model == "family" else subspace(lab.probe(self.probing))
        searched = replace(mpc, model=Fixed.of(found, mpc.sample_time), tuned=self.tuned)
        return tuned(
            lab, searched.entries, searched.controller, initial=[searched.whole(())], over=self.over, by=self.by
        )
