"""Methods that get one linear model in one go, and leave the MPC as it is."""

from collections.abc import Iterator
from dataclasses import dataclass

from ...campaign import Pilot
from ...model import StateSpace, subspace
from ...plant import SimulatedPlant
from ..lab import Information, Lab, Method, identified


@dataclass(frozen=True)
class Identified(Method):
    """The study's MPC on the model of its family that predicts a probing record best.

    Parameters
    ----------
    probing
        s of probing.
    """

    probing: float = 20.0

    def offers(self, lab: Lab) -> Iterator[Pilot]:
        yield lab.study.mpc.controller_for(identified(lab, self.probing))


@dataclass(frozen=True)
class Subspace(Method):
    """The study's MPC on the model that N4SID finds in a probing record; see :func:`subspace`.

    Parameters
    ----------
    probing
        s of probing.
    """

    probing: float = 40.0

    def offers(self, lab: Lab) -> Iterator[Pilot]:
        yield lab.study.mpc.controller_for(subspace(lab.probe(self.probing)))


@dataclass(frozen=True)
class Linearised(Method):
    """The study's MPC on the linearisation of the rod itself about rest."""

    @property
    def information(self) -> Information:
        return "plant model"

    def offers(self, lab: Lab) -> Iterator[Pilot]:
        yield lab.study.mpc.controller_for(linearised(lab))


def linearised(lab: Lab) -> StateSpace:
    """The rod about rest, sampled.

    Raises
    ------
    TypeError
        The plant is no simulated rod.
    """
    plant = lab.study.plant
    if not isinstance(plant, SimulatedPlant):
        raise TypeError(f"only a simulated rod can be linearised, not {type(plant).__name__}")
    rest = plant.rod.resting(lab.study.mpc.input_bounds)
    return StateSpace(*plant.rod.linearise(rest, plant.sample_time, plant.sensor))
