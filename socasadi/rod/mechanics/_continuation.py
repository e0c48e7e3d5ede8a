from __future__ import annotations

from collections.abc import Callable
from math import ceil

import casadi as ca
import numpy as np
from scipy.linalg import eigh

_ITERATIONS = 25
_LARGEST_TURN = 0.7  # rad of section rotation that one Newton step may add before it is shortened
_SMALLEST_STEP = 1 / 8192  # of the loads
_LARGEST_STEP = 0.3  # rad of section rotation that one load step may add: longer ones lose the branch at a bifurcation
_AS_WEAK = 0.05  # relative stiffness by which directions of buckling are told from others
_NO_SIDE = 1e-12
_REDUNDANT = 1e-11


class Continuation:
    """Follows an equilibrium as its loads grow from nothing, by Newton's method.

    Parameters
    ----------
    residual
        CasADi Function (y, input, tip, load) -> (residual, its Jacobian with respect to y); ``load`` goes from 0 to 1.
    turn
        Rotation between base and tip, rad, that unknowns of a size make.
    possible
        Whether there is a rod in that state.
    stiffness
        Elastic stiffness: where the Jacobian is a tangent stiffness, an equilibrium that buckles leaves its branch on
        the side to which an imperfection points. None where cables are held at their lengths: their tensions are
        unknowns too, of which there may be more than the strains need.
    """

    def __init__(
        self,
        residual: ca.Function,
        turn: Callable[[np.ndarray], float],
        possible: Callable[[np.ndarray], bool],
        stiffness: np.ndarray | None = None,
    ) -> None:
        self._residual, self._turn, self._possible, self._stiffness = residual, turn, possible, stiffness

    def follow(self, loads: tuple[np.ndarray, ...]) -> tuple[np.ndarray, float]:
        """Equilibrium reached from the unloaded state, and the part of the loads there: 1 unless it was lost."""
        y = np.zeros(self._residual.numel_in(0))
        (before, tangent), (after, _) = self._at(y, loads, 0.0), self._at(y, loads, 1.0)
        increment = np.linalg.lstsq(tangent, before - after, rcond=None)[0]
        step, stable, done = 1 / max(1, ceil(self._turn(increment) / _LARGEST_STEP)), True, 0.0
        while done < 1:
            target = min(1.0, done + step)
            reached = self.converge(y, loads, target)
            still_stable = stable and reached is not None and self._stable(reached, loads, target)
            followed = reached is not None and still_stable == stable and self._turn(reached - y) <= _LARGEST_STEP
            if not followed and step > _SMALLEST_STEP:
                step /= 2
                continue
            aside = self._branch(y, increment, loads, done) if stable and not followed else None
            if aside is not None:
                (reached, target), still_stable = aside, True
            if reached is None:
                break
            increment = reached - y
            y, done, step, stable = reached, target, 1.5 * step, still_stable
        return y, done

    def converge(self, y: np.ndarray, loads: tuple[np.ndarray, ...], part: float) -> np.ndarray | None:
        """Unknowns near ``y`` at which the residual vanishes to rounding under a part of the loads, or None."""
        previous = np.inf
        for _ in range(_ITERATIONS):
            residual, tangent = self._at(y, loads, part)
            if not (np.isfinite(residual).all() and np.isfinite(tangent).all()):
                return None
            change = self._change(residual, tangent)
            if change is None:
                return None
            y = y + change * min(1.0, _LARGEST_TURN / max(self._turn(change), 1e-300))
            size = np.linalg.norm(change) / (1 + np.linalg.norm(y))
            if size < 1e-9 and (size < 1e-14 or size >= previous / 2):
                return y if self._possible(y) else None
            previous = size
        return None

    def _change(self, residual: np.ndarray, tangent: np.ndarray) -> np.ndarray | None:
        """Newton's step; the least of many where tensions can be chosen."""
        try:
            if self._stiffness is None:
                return np.linalg.lstsq(tangent, -residual, rcond=_REDUNDANT)[0]
            return np.linalg.solve(tangent, -residual)
        except np.linalg.LinAlgError:
            return None

    def tangent(self, y: np.ndarray, loads: tuple[np.ndarray, ...], part: float = 1.0) -> np.ndarray:
        """Jacobian of the residual under a part of the loads."""
        return self._at(y, loads, part)[1]

    def _at(self, y: np.ndarray, loads: tuple[np.ndarray, ...], part: float) -> tuple[np.ndarray, np.ndarray]:
        residual, tangent = (value.full() for value in self._residual(y, *loads, part))
        return residual[:, 0], tangent

    def _stable(self, y: np.ndarray, loads: tuple[np.ndarray, ...], part: float) -> bool:
        """Whether a small push meets resistance there; yes where that is not looked into."""
        if self._stiffness is None:
            return True
        tangent = self.tangent(y, loads, part)
        return bool(np.linalg.eigvalsh((tangent + tangent.T) / 2)[0] > 0)

    def _branch(
        self, y: np.ndarray, increment: np.ndarray, loads: tuple[np.ndarray, ...], done: float
    ) -> tuple[np.ndarray, float] | None:
        """A stable equilibrium on the branch that leaves a bifurcation just beyond ``y``, and its part of the loads.

        On the side to which the last increment points; None where it points to none, as for a perfect column.
        """
        if self._stiffness is None:
            return None
        tangent = self.tangent(y, loads, done)
        softness, shapes = eigh((tangent + tangent.T) / 2, self._stiffness)
        weak = shapes[:, softness < softness[0] + _AS_WEAK]
        direction = weak @ (weak.T @ self._stiffness @ increment)
        if np.linalg.norm(direction) <= _NO_SIDE * np.linalg.norm(increment):
            return None
        direction /= self._turn(direction)
        for ahead in (1 / 256, 1 / 64, 1 / 16):
            part = min(1.0, done + ahead)
            for turn in (0.1, 0.3, 1.0):
                reached = self.converge(y + turn * direction, loads, part)
                if reached is None or not self._stable(reached, loads, part):
                    continue
                if direction @ self._stiffness @ (reached - y) > 0:
                    return reached, part
        return None
