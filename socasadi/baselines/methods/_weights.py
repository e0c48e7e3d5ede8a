from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Literal

from ...campaign import Pilot
from ...model import Fixed, subspace
from ...plant import Plant
from ..lab import Information, Lab, Method, identified, tuned
from ._fixed import linearised


@dataclass(frozen=True)
class WeightSearch(Method):
    """A model is identified once, and what the study's MPC assumes and weighs is tuned by flights.

    Neumann-Brosig, Marco, Schwarzmann, Trimpe, "Data-efficient autotuning with Bayesian optimization: an industrial
    control study", IEEE Trans. Control Systems Technology 28(3), 2020 (arXiv 1812.06325), for an MPC.

    Parameters
    ----------
    model
        ``"family"``, the member of the study's family that predicts a probing record best; ``"subspace"``, see
        :func:`socasadi.model.subspace`; ``"linearised"``, the rod that is known about rest, without a record.
    probing
        s of probing.
    kind
        ``"bayesian"``; ``"sobol"`` and ``"random"`` are points that learn nothing.
    tuned
        Settings that theta holds, as of :class:`LinearMPC`. Of Q and R only the quotient matters, and of the sensor's
        noise and the others.
    over, by
        Other robots on which every controller is flown beside the study's, and whether the mean or the worst J counts:
        a search for robustness, whose flights cost as many times the robot's time.
    most
        Trials, at most; None: as many as there is time for.
    """

    model: Literal["family", "subspace", "linearised"] = "family"
    probing: float = 40.0
    kind: Literal["bayesian", "sobol", "random"] = "bayesian"
    tuned: tuple = ("R", "input_noise", "disturbance_noise")
    over: tuple[Callable[[Plant], Plant], ...] = ()
    by: Literal["mean", "worst"] = "mean"
    most: int | None = None

    @property
    def information(self) -> Information:
        return "plant model" if self.model == "linearised" else "other robots" if self.over else "data sheet"

    def offers(self, lab: Lab) -> Iterator[Pilot]:
        match self.model:
            case "family":
                model = identified(lab, self.probing)
            case "subspace":
                model = subspace(lab.probe(self.probing))
            case "linearised":
                model = linearised(lab)
            case _:
                raise ValueError(f"unknown model {self.model!r}; there are family, subspace, linearised")
        mpc = lab.study.mpc
        searched = replace(mpc, model=Fixed.of(model, mpc.sample_time), tuned=self.tuned)
        return tuned(
            lab,
            searched.entries,
            searched.controller,
            kind=self.kind,
            initial=[searched.whole(())],
            over=self.over,
            by=self.by,
            most=float("inf") if self.most is None else self.most,
        )
