from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from math import ceil
from typing import TYPE_CHECKING

import casadi as ca
import numpy as np
from scipy.linalg import eigh

from ._elasticity import spin_gram
from ._model import TIP_LOADS

if TYPE_CHECKING:
    from .._rod import Rod

_ITERATIONS = 25
_SMALLEST_LOAD_STEP = 1 / 8192
_LARGEST_STEP = 0.3  # rad of section rotation that one load step may add: longer ones lose the branch at a bifurcation
_AS_WEAK = 0.05  # relative stiffness by which directions of buckling are told from others
_NO_SIDE = 1e-12
_LOOKED_AT = 33  # places along the rod whose stretch is looked at
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
        parametrised. Below zero the equilibrium is unstable.
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
    """Newton's method on the static residual of one rod, with load continuation.

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
        self._newton = ca.Function("newton", [q, u, tip, load], [residual, ca.jacobian(residual, q)])

        tension, both = ca.MX.sym("tension", m), ca.MX.sym("both", n + m)
        missed = lengths - self._relaxed - load * (u - self._relaxed)
        residual = ca.vertcat(elastic - applied - actuation @ tension, missed)
        residual = ca.substitute(residual, ca.vertcat(q, tension), both)
        self._held = ca.Function("held", [both, u, tip, load], [residual, ca.jacobian(residual, both)])

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
        q = None if start is None else self._converge(self._newton, start, loads, 1.0)
        if q is None:
            q = self._continuation(self._newton, np.zeros(self._rod.dof), loads)
        return self._at(q, given, self._rod.model.tensions(q, given).full()[:, 0], tip_load)

    def solve_lengths(self, lengths: np.ndarray, tip_load: np.ndarray) -> Equilibrium:
        """Equilibrium with cables of exactly these lengths (cables,), by whatever tensions that takes."""
        n = self._rod.dof
        both = self._continuation(self._held, np.zeros(n + len(lengths)), (lengths, tip_load))
        return self._at(both[:n], np.where(self._by_length, lengths, both[n:]), both[n:], tip_load)

    def tangent(self, equilibrium: Equilibrium) -> np.ndarray:
        """Tangent stiffness (n, n) at an equilibrium."""
        return self._newton(equilibrium.q, equilibrium.input, equilibrium.tip_load, 1.0)[1].full()

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

    def _continuation(self, newton: ca.Function, y: np.ndarray, loads: tuple[np.ndarray, ...]) -> np.ndarray:
        done = 0.0
        residual, tangent = (value.full() for value in newton(y, *loads, 0.0))
        pull = newton(y, *loads, 1.0)[0].full() - residual
        linear = np.linalg.lstsq(tangent, -pull[:, 0], rcond=None)[0]
        step, stable, increment = 1 / max(1, ceil(self._turn(linear) / _LARGEST_STEP)), True, linear
        while done < 1:
            target = min(1.0, done + step)
            reached = self._converge(newton, y, loads, target)
            still_stable = stable and reached is not None and self._stable(newton, reached, loads, target)
            followed = reached is not None and still_stable == stable and self._turn(reached - y) <= _LARGEST_STEP
            if not followed and step > _SMALLEST_LOAD_STEP:
                step /= 2
                continue
            aside = self._branch(newton, y, increment, loads, done) if stable and not followed else None
            if aside is not None:
                (reached, target), still_stable = aside, True
            if reached is None:
                raise EquilibriumError(self._failure(loads, done))
            increment = reached - y
            y, done, step, stable = reached, target, 1.5 * step, still_stable
        return y

    def _stable(self, newton: ca.Function, y: np.ndarray, loads: tuple[np.ndarray, ...], fraction: float) -> bool:
        """Whether a small push meets resistance there (cables held at their lengths are not looked into)."""
        if newton is self._held:
            return True
        tangent = newton(y, *loads, fraction)[1].full()
        return bool(np.linalg.eigvalsh((tangent + tangent.T) / 2)[0] > 0)

    def _branch(
        self, newton: ca.Function, y: np.ndarray, increment: np.ndarray, loads: tuple[np.ndarray, ...], done: float
    ) -> tuple[np.ndarray, float] | None:
        """A stable equilibrium on the branch that leaves a bifurcation just beyond y, and its part of the loads.

        On the side to which the last increment points; None where it points to none, as for a perfect column.
        """
        tangent, stiffness = newton(y, *loads, done)[1].full(), self._rod.stiffness.full()
        softness, shapes = eigh((tangent + tangent.T) / 2, stiffness)
        weak = shapes[:, softness < softness[0] + _AS_WEAK]
        direction = weak @ (weak.T @ stiffness @ increment)
        if np.linalg.norm(direction) <= _NO_SIDE * np.linalg.norm(increment):
            return None
        direction /= self._turn(direction)
        for ahead in (1 / 256, 1 / 64, 1 / 16):
            target = min(1.0, done + ahead)
            for turn in (0.1, 0.3, 1.0):
                reached = self._converge(newton, y + turn * direction, loads, target)
                if (
                    reached is not None
                    and self._stable(newton, reached, loads, target)
                    and direction @ stiffness @ (reached - y) > 0
                ):
                    return reached, target
        return None

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

    def _converge(
        self, newton: ca.Function, y: np.ndarray, loads: tuple[np.ndarray, ...], fraction: float
    ) -> np.ndarray | None:
        """Unknowns at which the residual vanishes to rounding, or None."""
        previous = np.inf
        for _ in range(_ITERATIONS):
            residual, tangent = (value.full() for value in newton(y, *loads, fraction))
            if not (np.isfinite(residual).all() and np.isfinite(tangent).all()):
                return None
            try:
                change = np.linalg.solve(tangent, -residual[:, 0])
            except np.linalg.LinAlgError:
                return None
            y = y + change * min(1.0, _LARGEST_TURN / max(self._turn(change), 1e-300))
            size = np.linalg.norm(change) / (1 + np.linalg.norm(y))
            if size < 1e-9 and (size < 1e-14 or size >= previous / 2):
                # The linear law goes on where the rod is turned inside out, but no rod does.
                return y if float(self._stretch(y[: self._rod.dof])) > 0 else None
            previous = size
        return None

    def _turn(self, y: np.ndarray) -> float:
        """Rotation between base and tip that coordinates of this size make, rad, root mean square along the rod."""
        q = y[: self._rod.dof]
        return float(np.sqrt(q @ self._spin @ q))
