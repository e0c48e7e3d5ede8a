"""Methods that get one linear model in one go, and leave the MPC as it is."""

from collections.abc import Iterator
from dataclasses import dataclass

from ...campaign import Pilot
from ...model import StateSpace, subspace
from ...plant import SimulatedPlant
from ..lab import Information, Lab, Method, Probed, identified


@dataclass(frozen=True)
class Identified(Probed):
    """The study's MPC on the model of its family that predicts a probing record best.

    Parameters
    ----------
    probing
        s of probing.
    """

    def offers(self, lab: Lab) -> Iterator[Pilot]:
        yield lab.study.mpc.controller_for(identified(lab, self.probing))


@dataclass(frozen=True)
class Subspace(Probed):
    """The study's MPC on the model that N4SID finds in a probing record; see :func:`subspace`.

    Parameters
    ----------
    probing
        s of probing.
    """

    def offers(self, lab: Lab) -> Iterator[Pilot]:
        yield lab.study.mpc.controller_for(subspace(lab.probe(self.probing)))


@dataclass(frozen=True)
class Linearised(Method):
    """The study's MPC on the linearisation about rest of the rod that is known."""

    @property
    def information(self) -> Information:
        return "plant model"

    def offers(self, lab: Lab) -> Iterator[Pilot]:
        yield lab.study.mpc.controller_for(linearised(lab))


def known_rod(lab: Lab) -> SimulatedPlant:
    """The plant that is known.

    Raises
    ------
    TypeError
        It is no simulated rod.
    """
    if not isinstance(lab.known, SimulatedPlant):
        raise TypeError(f"only a simulated rod has a model to take, not {type(lab.known).__name__}")
    return lab.known


def linearised(lab: Lab) -> StateSpace:
    """The rod that is known, about rest, sampled."""
    plant = known_rod(lab)
    rest = plant.rod.resting(lab.study.mpc.input_bounds)
    return StateSpace(*plant.rod.linearise(rest, plant.sample_time, plant.sensor))
