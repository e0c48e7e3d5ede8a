from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

from ...campaign import Pilot
from ..lab import Lab, Method, tuned


@dataclass(frozen=True)
class ModelSearch(Method):
    """The prediction model that controls best, sought in closed loop, as in arXiv 2210.08780.

    Parameters
    ----------
    kind
        ``"bayesian"``; ``"sobol"`` and ``"random"`` are points that learn nothing, on the same theta.
    """

    kind: Literal["bayesian", "sobol", "random"] = "bayesian"

    def offers(self, lab: Lab) -> Iterator[Pilot]:
        mpc = lab.study.mpc
        return tuned(lab, mpc.entries, mpc.controller, kind=self.kind)
