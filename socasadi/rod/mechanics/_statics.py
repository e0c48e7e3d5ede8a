from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import casadi as ca
import numpy as np

from ._continuation import Continuation
from ._elasticity import spin_gram
from ._model import TIP_LOADS

if TYPE_CHECKING:
    from .._rod import Rod

_MISSED = 1e-9  # of the rod's length
_LOOKED_AT = 33  # places along the rod whose stretch is looked at


class EquilibriumError(RuntimeError):
    """No static equilibrium was found; the message says for which loads, or by how much a tip is out of reach."""


@dataclass(frozen=True, eq=False)
class Equilibrium:
    """A static equilibrium of a rod.

    Attributes
    ----------
    q
        Strain coordinates (n,).
    input
        What the cables and chambers are given (cables,): tensions, N, pressures, Pa, lengths, m.
    tension
        What that comes to (cables,): tensions, N, and pressures, Pa.
    tip, rotation
        Position (3,), m, and rotation matrix (3, 3) of the tip section, world frame.
    tip_load
        Dead moment and force, world frame, and follower moment and force, tip frame: (12,), N m and N.
    """

    rod: Rod = field(repr=False)
    q: np.ndarray
    input: np.ndarray
    tension: np.ndarray
    tip: np.ndarray
    rotation: np.ndarray
    tip_load: np.ndarray

    @property
    def state(self) -> np.ndarray:
        """The state at rest there, (2 n,): q and zero rates."""
        return np.concatenate([self.q, np.zeros_like(self.q)])

    @property
    def lengths(self) -> np.ndarray:
        """Lengths (cables,) of the cables, m."""
        return self.rod.model.cable_lengths(self.q).full()[:, 0]

    def frames(self, n: int = 50) -> np.ndarray:
        """Homogeneous poses (n, 4, 4) of ``n`` sections evenly spaced along the rod, base first and tip last."""
        return self.rod.frames(self.q, n)

    def centreline(self, n: int = 50) -> np.ndarray:
        """Positions (n, 3), m, of ``n`` points evenly spaced along the rod, base first and tip last."""
        return self.rod.centreline(self.q, n)

    @cached_property
    def stiffness(self) -> np.ndarray:
        """Tangent stiffness (n, n): derivative of the elastic force less the loads with respect to q.

        Symmetric but for follower loads and friction.
        """
        return self.rod.statics.tangent(self)

    @property
    def stability(self) -> float:
        """Smallest eigenvalue of the tangent stiffness relative to the elastic: 1 without loads, 0 where it buckles.

        It is the smallest real part of an eigenvalue of K^-1 K_tangent, which does not depend on how the strain is
        parametrised. Below zero the equilibrium is unstable. Above zero it may still flutter under follower loads:
        the eigenvalues of A of :meth:`Rod.linearise` tell.
        """
        return float(np.linalg.eigvals(np.linalg.solve(self.rod.stiffness.full(), self.stiffness)).real.min())

    @property
    def compliance(self) -> np.ndarray:
        """Small rotation, rad, and displacement, m, of the tip per moment, N m, and force, N, added there: (6, 6).

        All in world axes, the rotational part first. The cables' inputs are held.
        """
        jacobian = self.rod.statics.tip_jacobian(self.q)
        return jacobian @ np.linalg.solve(self.stiffness, jacobian.T)


class Statics:
    """The equilibria of one rod, by load continuation.

    Loads grow together from nothing: gravity, what hangs on the rod, tensions, the tip's load; the length of a cable
    goes from that of the unloaded rod to the one asked for.
    """

    def __init__(self, rod: Rod) -> None:
        self._rod = rod
        model, n, m = rod.model, rod.dof, len(rod.cables)
        q, u, tip, load = ca.MX.sym("q", n), ca.MX.sym("u", m), ca.MX.sym("tip", TIP_LOADS), ca.MX.sym("load")
        R, p, J, constant, _ = model.statics(q)
        actuation, lengths = model.actuation(q), model.cable_lengths(q)
        self._relaxed = model.cable_lengths(np.zeros(n)).full()[:, 0]
        self._by_length = np.array([cable.drive == "length" for cable in rod.cables], dtype=bool)
        wrench = ca.vertcat(R.T @ tip[:3], R.T @ tip[3:6]) + tip[6:]
        elastic, applied = model.stiffness @ q, load * (constant + J.T @ wrench)

        relaxed = self._relaxed * self._by_length
        given = relaxed + load * (u - relaxed)
        residual = elastic - applied - actuation @ model.tensions(q, given)
        free = ca.Function("free", [q, u, tip, load], [residual, ca.jacobian(residual, q)])

        tension, both = ca.MX.sym("tension", m), ca.MX.sym("both", n + m)
        missed = lengths - self._relaxed - load * (u - self._relaxed)
        residual = ca.vertcat(elastic - applied - actuation @ tension, missed)
        residual = ca.substitute(residual, ca.vertcat(q, tension), both)
        held = ca.Function("held", [both, u, tip, load], [residual, ca.jacobian(residual, both)])

        self._free = Continuation(free, self._turn, self._possible, rod.stiffness.full())
        self._held = Continuation(held, self._turn, self._possible)
        self._tip = ca.Function("tip", [q], [p, R, ca.vertcat(R @ J[:3, :], R @ J[3:, :])])
        self._spin = spin_gram(rod.divisions)
        places = np.linspace(0, rod.length, _LOOKED_AT)
        self._stretch = ca.Function("stretch", [q], [ca.mmin(ca.vertcat(*(model.strain(q, s)[3] for s in places)))])

    @property
    def neutral(self) -> np.ndarray:
        """Inputs (cables,) that leave the unloaded rod alone: zero, or the length that a cable has there."""
        return self._relaxed * self._by_length

    def solve(self, given: np.ndarray, tip_load: np.ndarray, start: np.ndarray | None = None) -> Equilibrium:
        """Equilibrium under inputs (cables,) and a tip load (12,), tried first from the coordinates ``start``."""
        loads = (given, tip_load)
        q = None if start is None else self._free.converge(start, loads, 1.0)
        if q is None:
            q = self._followed(self._free, loads)
        return self._at(q, given, self._rod.model.tensions(q, given).full()[:, 0], tip_load)

    def solve_lengths(self, lengths: np.ndarray, tip_load: np.ndarray) -> Equilibrium:
        """Equilibrium with cables of exactly these lengths (cables,), by whatever tensions that takes."""
        n = self._rod.dof
        both = self._followed(self._held, (lengths, tip_load))
        reached = self._rod.model.cable_lengths(both[:n]).full()[:, 0]
        missed = float(np.abs(reached - lengths).max(initial=0.0))
        if missed > _MISSED * self._rod.length:
            raise EquilibriumError(
                f"no tensions give the cables the lengths {lengths.tolist()} m together: the strains of the rod allow "
                f"{reached.round(6).tolist()} m at the nearest, {1e3 * missed:.3g} mm away; "
                "a free stretch or a cable less may allow them"
            )
        return self._at(both[:n], np.where(self._by_length, lengths, both[n:]), both[n:], tip_load)

    def tangent(self, equilibrium: Equilibrium) -> np.ndarray:
        """Tangent stiffness (n, n) at an equilibrium."""
        return self._free.tangent(equilibrium.q, (equilibrium.input, equilibrium.tip_load))

    def tip_jacobian(self, q: np.ndarray) -> np.ndarray:
        """Rotation and displacement of the tip (6, n), world axes, per coordinate."""
        return self._tip(q)[2].full()

    def tip_sensitivity(self, equilibrium: Equilibrium) -> np.ndarray:
        """Derivative (3, cables) of the tip's position with respect to the tensions, m/N, world frame."""
        actuation = self._rod.actuation(equilibrium.q).full()
        return self.tip_jacobian(equilibrium.q)[3:] @ np.linalg.solve(self.tangent(equilibrium), actuation)

    def _at(self, q: np.ndarray, given: np.ndarray, tension: np.ndarray, tip_load: np.ndarray) -> Equilibrium:
        tip, rotation, _ = (value.full() for value in self._tip(q))
        return Equilibrium(self._rod, q, given, tension, tip[:, 0], rotation, tip_load)

    def _followed(self, continuation: Continuation, loads: tuple[np.ndarray, ...]) -> np.ndarray:
        y, done = continuation.follow(loads)
        if done < 1:
            raise EquilibriumError(self._failure(loads, done))
        return y

    def _failure(self, loads: tuple[np.ndarray, ...], done: float) -> str:
        given, tip = (np.round(load, 9).tolist() for load in loads)
        parts = [f"cable inputs {given}"] if any(given) else []
        names = ("tip moment", "tip force", "follower moment", "follower force")
        parts += [f"{name} {tip[3 * i : 3 * i + 3]}" for i, name in enumerate(names) if any(tip[3 * i : 3 * i + 3])]
        parts += [f"gravity {list(self._rod.gravity)} m/s^2"] if any(self._rod.gravity) else []
        parts += ["the rod's own loads"] if self._rod.loads or self._rod.payloads else []
        return (
            f"no equilibrium found under {', '.join(parts)}: Newton's method stopped at {100 * done:.0f} % of the "
            "loads; the rod may buckle or be compressed to nothing there"
        )

    def _turn(self, y: np.ndarray) -> float:
        """Rotation between base and tip that coordinates of this size make, rad, root mean square along the rod."""
        q = y[: self._rod.dof]
        return float(np.sqrt(q @ self._spin @ q))

    def _possible(self, y: np.ndarray) -> bool:
        """Whether the rod is stretched by more than nothing: the linear law goes on beyond that, but no rod does."""
        return float(self._stretch(y[: self._rod.dof])) > 0
