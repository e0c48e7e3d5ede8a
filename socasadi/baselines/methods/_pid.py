from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ...campaign import Pilot
from ...model import Entry, subspace
from ...mpc import LinearMPC
from ..lab import FORESIGHT, Allocation, Foresight, Lab, Law, Probed, static_gain, tuned


@dataclass(frozen=True)
class PID(Probed):
    r"""Three terms per output through the inverse static Jacobian, which an identified model gives:

    .. math:: u = G^+ (f r_a + k_p e + k_i \int e\, dt + k_d \dot e_f)

    with the error's derivative filtered, or the inputs within the bounds that come nearest to it at rest. What is fed
    forward is the reference some samples ahead, smoothed. The seven numbers are tuned by flights.

    Parameters
    ----------
    probing
        s of probing.
    """

    def offers(self, lab: Lab) -> Iterator[Pilot]:
        allocation = Allocation(static_gain(subspace(lab.probe(self.probing))))
        knobs = (
            Entry("proportional", "1", 0.01, 10.0, "log"),
            Entry("integral", "1/s", 0.05, 20.0, "log"),
            Entry("derivative", "s", 0.001, 2.0, "log"),
            Entry("filter", "s", 0.01, 1.0, "log"),
            Entry("fed forward", "1", 0.0, 1.0),
            *FORESIGHT,
        )
        mpc, first = lab.study.mpc, (0.1, 1.0, 0.05, 0.1, 1.0, 0.5, 0.05)
        return tuned(lab, knobs, lambda gains: _Controller(mpc, allocation, gains), initial=[first])


class _Controller(Law):
    def __init__(self, mpc: LinearMPC, allocation: Allocation, gains: np.ndarray) -> None:
        super().__init__(mpc)
        self._allocation, self._gains = allocation, gains[:5]
        self._foresight = Foresight(mpc.sample_time, *gains[5:])
        self.begin()

    def begin(self) -> None:
        self._foresight.begin()
        self._integral, self._slope = np.zeros(self.mpc.outputs), np.zeros(self.mpc.outputs)
        self._error: np.ndarray | None = None

    def act(self, y: np.ndarray, reference: np.ndarray) -> np.ndarray:
        proportional, integral, derivative, filtered, forward = self._gains
        time, error = self.mpc.sample_time, reference[0] - y
        if self._error is not None:
            smooth = time / (time + filtered)
            self._slope = self._slope + smooth * ((error - self._error) / time - self._slope)
        self._error = error
        known = forward * self._foresight.ahead(y, reference) + proportional * error + derivative * self._slope
        summed = self._integral + time * error
        u, missed = self._allocation.inputs(known + integral * summed, self.allowed)
        # The integral of an output that bounds keep from going further waits, lest it winds up.
        self._integral = np.where(missed * error > 0, self._integral, summed)
        return u
