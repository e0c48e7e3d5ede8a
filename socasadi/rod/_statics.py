from __future__ import annotations

from dataclasses import dataclass, field
from math import ceil
from typing import TYPE_CHECKING

import casadi as ca
import numpy as np

if TYPE_CHECKING:
    from ._rod import Rod

_ITERATIONS = 25
_SMALLEST_LOAD_STEP = 1 / 256
_LARGEST_TURN = 0.7  # rad of section rotation that one Newton step may add before it is shortened


class EquilibriumError(RuntimeError):
    """No static equilibrium was found; the message says for which loads, or by how much a tip is out of reach."""


@dataclass(frozen=True, eq=False)
class Equilibrium:
    """A static equilibrium of a rod.

    Attributes
    ----------
    q
        Strain coordinates (n,).
    tension
        Cable tensions (cables,), N.
    tip, rotation
        Position (3,), m, and rotation matrix (3, 3) of the tip section, base frame.
    tip_force, tip_moment
        The dead loads (3,), N and N m, base frame.
    """

    rod: Rod = field(repr=False)
    q: np.ndarray
    tension: np.ndarray
    tip: np.ndarray
    rotation: np.ndarray
    tip_force: np.ndarray
    tip_moment: np.ndarray

    @property
    def state(self) -> np.ndarray:
        """The state at rest there, (2 n,): q and zero rates."""
        return np.concatenate([self.q, np.zeros_like(self.q)])

    def centreline(self, n: int = 50) -> np.ndarray:
        """Positions (n, 3), m, of ``n`` points evenly spaced along the rod, base first and tip last."""
        return self.rod.centreline(self.q, n)


class Statics:
    """Newton's method on the static residual of one rod, with load continuation."""

    def __init__(self, rod: Rod) -> None:
        self._rod = rod
        model, n, cables = rod.model, rod.dof, len(rod.cables)
        q, u = ca.MX.sym("q", n), ca.MX.sym("u", cables)
        force, moment, load = ca.MX.sym("force", 3), ca.MX.sym("moment", 3), ca.MX.sym("load")
        R, p, J, gravity, _ = model.statics(q)
        actuation = model.actuation(q)
        applied = gravity + actuation @ u + J.T @ ca.vertcat(R.T @ moment, R.T @ force)
        residual = model.stiffness @ q - load * applied
        arguments = [q, u, force, moment, load]
        self._newton = ca.Function("newton", arguments, [residual, ca.jacobian(residual, q)])
        self._tip = ca.Function("tip", [q], [p, R, R @ J[3:, :]])
        self._stiffness = model.stiffness.full()
        spin = rod.strain.gram(np.array([1.0, 1.0, 1.0, 0, 0, 0]))
        self._spin = rod.length**2 * spin

    def solve(
        self,
        tension: np.ndarray,
        tip_force: np.ndarray,
        tip_moment: np.ndarray,
        start: np.ndarray | None = None,
    ) -> Equilibrium:
        loads = (tension, tip_force, tip_moment)
        q = None if start is None else self._converge(start, loads, 1.0)
        if q is None:
            q = self._continuation(loads)
        tip, rotation, _ = (value.full() for value in self._tip(q))
        return Equilibrium(self._rod, q, tension, tip[:, 0], rotation, tip_force, tip_moment)

    def tangent(self, equilibrium: Equilibrium) -> np.ndarray:
        """Tangent stiffness (n, n): elastic and of the loads, at an equilibrium."""
        loads = (equilibrium.tension, equilibrium.tip_force, equilibrium.tip_moment)
        return self._newton(equilibrium.q, *loads, 1.0)[1].full()

    def tip_sensitivity(self, equilibrium: Equilibrium) -> np.ndarray:
        """Derivative (3, cables) of the tip's position with respect to the tensions, m/N."""
        actuation = self._rod.actuation(equilibrium.q).full()
        return self._tip(equilibrium.q)[2].full() @ np.linalg.solve(self.tangent(equilibrium), actuation)

    def _continuation(self, loads: tuple[np.ndarray, ...]) -> np.ndarray:
        q, done = np.zeros(self._rod.dof), 0.0
        linear = np.linalg.solve(self._stiffness, -self._newton(q, *loads, 1.0)[0].full()[:, 0])
        step = 1 / max(1, ceil(self._turn(linear) / 2))
        while done < 1:
            target = min(1.0, done + step)
            reached = self._converge(q, loads, target)
            if reached is not None:
                q, done, step = reached, target, 1.5 * step
            elif step > _SMALLEST_LOAD_STEP:
                step /= 2
            else:
                tension, force, moment = (load.tolist() for load in loads)
                raise EquilibriumError(
                    f"no equilibrium found for tension {tension} N, tip force {force} N, tip moment {moment} N m, "
                    f"gravity {list(self._rod.gravity)} m/s^2: Newton stopped at {100 * done:.0f} % of the loads; "
                    "the rod may buckle or be compressed to nothing there"
                )
        return q

    def _converge(self, q: np.ndarray, loads: tuple[np.ndarray, ...], fraction: float) -> np.ndarray | None:
        """Coordinates at which the residual vanishes to rounding, or None."""
        previous = np.inf
        for _ in range(_ITERATIONS):
            residual, tangent = (value.full() for value in self._newton(q, *loads, fraction))
            if not (np.isfinite(residual).all() and np.isfinite(tangent).all()):
                return None
            try:
                change = np.linalg.solve(tangent, -residual[:, 0])
            except np.linalg.LinAlgError:
                return None
            q = q + change * min(1.0, _LARGEST_TURN / max(self._turn(change), 1e-300))
            size = np.linalg.norm(change) / (1 + np.linalg.norm(q))
            if size < 1e-9 and (size < 1e-14 or size >= previous / 2):
                return q
            previous = size
        return None

    def _turn(self, q: np.ndarray) -> float:
        """Rotation between base and tip that coordinates of this size make, rad, root mean square along the rod."""
        return float(np.sqrt(q @ self._spin @ q))
