from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import TYPE_CHECKING

import casadi as ca
import numpy as np
from scipy.optimize import least_squares

from .._checks import vector
from ._model import TIP_LOADS
from ._statics import Equilibrium, EquilibriumError, Statics

if TYPE_CHECKING:
    from .._rod import Rod

_ITERATIONS = 40
_REACHED = 1e-6  # of the length: a nearest pose that misses by less counts as reached
_NO_LOAD = np.zeros(TIP_LOADS)


class Holding:
    """The tensions of least norm, within bounds, that hold the tip at a given (y, z).

    A sequence of quadratic programs: the tip is linearised in the tensions about the static pose of the last ones,
    min |u|^2 subject to that linearised tip being the target and u within the bounds. When such a program has no
    solution, the nearest reachable pose decides whether the target is out of reach or the linearisation was.
    """

    def __init__(self, rod: Rod, statics: Statics, bounds: tuple[np.ndarray, np.ndarray]) -> None:
        self._rod, self._statics = rod, statics
        self._lower, self._upper = bounds

    def at(self, tip: Sequence[float] | np.ndarray) -> Equilibrium:
        """Equilibrium with its tip at ``tip`` = (y, z), m; EquilibriumError when there is none."""
        target = vector("Rod.equilibrium_at", "tip", tip, 2)
        if not self._rod.cables:
            raise EquilibriumError("a rod without cables cannot hold its tip away from rest; give it cables")
        if any(cable.drive == "length" for cable in self._rod.cables):
            raise EquilibriumError("tensions of least norm hold a tip, but this rod has cables driven by their length")
        rest = self._statics.solve(self._clip(np.zeros(len(self._rod.cables))), _NO_LOAD)
        held = self._least_norm(rest, target)
        if held is None:
            nearest = self._nearest(rest, target)
            if np.count_nonzero(self._lower < self._upper) <= 2:
                return nearest  # two coordinates held by two free cables leave nothing to choose
            held = self._least_norm(nearest, target)
        if held is None:
            raise EquilibriumError(
                f"the tip can be at (y, z) = ({target[0]:g}, {target[1]:g}) m, but the tensions of least norm that "
                "hold it there were not found; tighter tension bounds may help"
            )
        return held

    def _least_norm(self, latest: Equilibrium, target: np.ndarray) -> Equilibrium | None:
        for _ in range(_ITERATIONS):
            slope = self._slope(latest)
            tension = self._program(slope, slope @ latest.tension + target - self._tip(latest))
            if tension is None:
                return None
            change = float(np.abs(tension - latest.tension).max())
            try:
                latest = self._statics.solve(tension, _NO_LOAD, latest.q)
            except EquilibriumError:
                return None
            if change < 1e-9 * (1 + float(np.abs(tension).max())):
                return latest
        return None

    def _program(self, slope: np.ndarray, value: np.ndarray) -> np.ndarray | None:
        """argmin |u|^2 subject to ``slope`` u = ``value`` and the bounds, or None when there is no such u."""
        # In units of the tension that the linearisation needs, so that the solver's tolerances fit.
        unit = max(float(np.abs(np.linalg.pinv(slope) @ value).max()), 1e-6)
        size = self._rod.length
        solver, rows = _quadratic_program(len(self._rod.cables)), slope * unit / size
        answer = solver(
            h=ca.DM.eye(rows.shape[1]),
            a=rows,
            lba=value / size,
            uba=value / size,
            lbx=self._lower / unit,
            ubx=self._upper / unit,
        )
        return self._clip(answer["x"].full()[:, 0] * unit) if solver.stats()["success"] else None

    def _nearest(self, rest: Equilibrium, target: np.ndarray) -> Equilibrium:
        """The reachable pose whose tip is nearest to ``target``; EquilibriumError when that is not there."""
        latest, length = rest, self._rod.length

        def at(tension: np.ndarray) -> Equilibrium:
            nonlocal latest
            if not np.array_equal(tension, latest.tension):
                latest = self._statics.solve(tension, _NO_LOAD, latest.q)
            return latest

        def miss(tension: np.ndarray) -> np.ndarray:
            try:
                return (self._tip(at(tension)) - target) / length
            except EquilibriumError:
                return np.full(2, 1e3)  # no pose there: a trial that the trust region takes back

        def slope(tension: np.ndarray) -> np.ndarray:
            return self._slope(at(tension)) / length

        # The trust region keeps strictly inside bounds, so those of a fixed cable are set a hair apart.
        upper = np.maximum(self._upper, self._lower + 1e-9)
        margin = np.minimum(1e-3, 1e-3 * (upper - self._lower))
        start = np.clip(rest.tension, self._lower + margin, upper - margin)
        found = least_squares(
            miss,
            start,
            jac=slope,  # type: ignore[arg-type]
            bounds=(self._lower, upper),
            xtol=1e-14,
            ftol=1e-14,
            gtol=1e-14,
        )
        nearest = at(found.x)
        distance = float(np.linalg.norm(self._tip(nearest) - target))
        if distance > _REACHED * length:
            y, z = self._tip(nearest)
            raise EquilibriumError(
                f"the tip cannot be held at (y, z) = ({target[0]:g}, {target[1]:g}) m with tensions within the bounds: "
                f"the nearest static pose has it at ({y:.5f}, {z:.5f}) m, {1e3 * distance:.3g} mm away"
            )
        return nearest

    def _tip(self, equilibrium: Equilibrium) -> np.ndarray:
        """(y, z) of the tip, m, base frame."""
        return self._rod.in_base_frame(equilibrium.tip)[1:]

    def _slope(self, equilibrium: Equilibrium) -> np.ndarray:
        """Derivative (2, cables) of that with respect to the tensions, m/N."""
        rotation = np.array(self._rod.base_rotation)
        return (rotation.T @ self._statics.tip_sensitivity(equilibrium))[1:]

    def _clip(self, tension: np.ndarray) -> np.ndarray:
        return np.clip(tension, self._lower, self._upper)


@cache
def _quadratic_program(cables: int) -> ca.Function:
    shapes = {"h": ca.Sparsity.dense(cables, cables), "a": ca.Sparsity.dense(2, cables)}
    return ca.conic("least_norm", "daqp", shapes, {"error_on_fail": False})
