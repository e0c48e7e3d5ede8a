from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.linalg import solve_continuous_are

from ...campaign import Pilot
from ...model import Entry, StateSpace, subspace
from ...mpc import DesignError, LinearMPC
from ..lab import FORESIGHT, Allocation, Foresight, Lab, Law, Probed, static_gain, tuned

_ABOVE_LEAST = 1.1
"""gamma of the controller, as a factor on the least that there is."""
_SLOW = 1e-3
"""rad/s, pole that stands for an integrator."""


@dataclass(frozen=True)
class HInfinity(Probed):
    r"""H-infinity loop shaping on an identified model, behind the inverse static Jacobian (within the bounds).

    The plant, shaped by :math:`W = k (s + w) / s` in each channel, gets the controller that is the most robust against
    perturbations of its normalised coprime factors (McFarlane, Glover, "A loop-shaping design procedure using
    H-infinity synthesis", IEEE Trans. Automatic Control 37, 1992; formulas of Skogestad, Postlethwaite, "Multivariable
    feedback control", 2005, section 9.4). The gain k, the corner w, and what is fed forward are tuned by flights: a
    share of the reference, how many samples ahead, and how smooth.

    Parameters
    ----------
    probing
        s of probing.
    """

    def offers(self, lab: Lab) -> Iterator[Pilot]:
        mpc, model = lab.study.mpc, subspace(lab.probe(self.probing))
        allocation = Allocation(static_gain(model))
        knobs = (
            Entry("gain", "1", 0.03, 30.0, "log"),
            Entry("corner", "rad/s", 0.1, 30.0, "log"),
            Entry("fed forward", "1", 0.0, 1.0),
            *FORESIGHT,
        )
        first = (0.3, 2.0, 1.0, 0.5, 0.05)
        return tuned(lab, knobs, lambda x: _Controller(mpc, model, allocation, *x), initial=[first])


class _Controller(Law):
    """v = forward r_a + W (K (y - forward r) - (1 - forward) K(0) r), u = inverse v; r_a is r ahead, smoothed."""

    def __init__(
        self,
        mpc: LinearMPC,
        model: StateSpace,
        allocation: Allocation,
        gain: float,
        corner: float,
        forward: float,
        *ahead: float,
    ) -> None:
        super().__init__(mpc)
        p, one = mpc.outputs, np.eye(mpc.outputs)
        # k (s + w) / (s + slow)
        shaper = StateSpace(-_SLOW * one, one, gain * (corner - _SLOW) * one, gain * one)
        plant = _in_tustins_variable(model, allocation.inverse, mpc.sample_time)
        robust = _most_robust(_series(plant, shaper))
        self._static = robust.D - robust.C @ np.linalg.solve(robust.A, robust.B)
        self._allocation, self._forward, self._foresight = allocation, forward, Foresight(mpc.sample_time, *ahead)
        self._robust, self._shaper = _sampled(robust, mpc.sample_time), _sampled(shaper, mpc.sample_time)
        self._sizes = len(robust.A), p
        self.begin()

    def begin(self) -> None:
        self._foresight.begin()
        self._x, self._integral = (np.zeros(size) for size in self._sizes)

    def act(self, y: np.ndarray, reference: np.ndarray) -> np.ndarray:
        robust, shaper = self._robust, self._shaper
        wanted = reference[0]
        left = y - self._forward * wanted
        answer = robust.C @ self._x + robust.D @ left - (1 - self._forward) * self._static @ wanted
        v = self._forward * self._foresight.ahead(y, reference) + shaper.C @ self._integral + shaper.D @ answer
        u, missed = self._allocation.inputs(v, self.allowed)
        self._x = robust.A @ self._x + robust.B @ left
        # The integral of an output that bounds keep from going further waits, lest it winds up.
        further = shaper.A @ self._integral + shaper.B @ answer
        self._integral = np.where(missed * answer > 0, self._integral, further)
        return u


def _in_tustins_variable(model: StateSpace, inverse: np.ndarray, time: float) -> StateSpace:
    """A model without D from wanted to measured outputs, as a system in continuous time whose Tustin image it is.

    A law answers to what was measured before its sample: for it y_k = C x_k, where a step of the model gives y_{k+1}.
    """
    A, B, C = model.A, model.B @ inverse, model.C
    plus = np.linalg.inv(A + np.eye(len(A)))
    root = 2 / np.sqrt(time)
    return StateSpace(2 / time * plus @ (A - np.eye(len(A))), root * plus @ B, root * C @ plus, -C @ plus @ B)


def _sampled(system: StateSpace, time: float) -> StateSpace:
    from scipy.signal import cont2discrete  # takes its time to import

    matrices: Any = cont2discrete(tuple(system), time, "bilinear")
    return StateSpace(*matrices[:4])


def _series(after: StateSpace, before: StateSpace) -> StateSpace:
    return StateSpace(
        np.block([[after.A, after.B @ before.C], [np.zeros((len(before.A), len(after.A))), before.A]]),
        np.vstack([after.B @ before.D, before.B]),
        np.hstack([after.C, after.D @ before.C]),
        after.D @ before.D,
    )


def _most_robust(plant: StateSpace) -> StateSpace:
    """The controller y -> u, of positive feedback, that is the most robust for a shaped plant, or nearly so.

    Raises
    ------
    DesignError
        The Riccati equations have no solution.
    """
    A, B, C, D = plant
    R, S = np.eye(len(C)) + D @ D.T, np.eye(B.shape[1]) + D.T @ D
    across = A - B @ np.linalg.solve(S, D.T @ C)
    try:
        X = solve_continuous_are(across, B, C.T @ np.linalg.solve(R, C), S)
        Z = solve_continuous_are(across.T, C.T, B @ np.linalg.solve(S, B.T), R)
    except (ValueError, np.linalg.LinAlgError) as error:
        raise DesignError(f"no robust controller: {error}") from error
    square = (_ABOVE_LEAST**2) * (1 + float(np.abs(np.linalg.eigvals(X @ Z)).max()))
    F = -np.linalg.solve(S, D.T @ C + B.T @ X)
    gain = square * np.linalg.solve(((1 - square) * np.eye(len(A)) + X @ Z).T, Z @ C.T)
    return StateSpace(A + B @ F + gain @ (C + D @ F), gain, B.T @ X, -D.T)
