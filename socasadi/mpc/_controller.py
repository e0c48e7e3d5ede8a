from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from ..codegen import Buffered
from ._design import Design
from ._law import control_law, rest_state
from ._qp import quiet

if TYPE_CHECKING:
    from ._spec import LinearMPC


@dataclass
class ControllerInfo:
    """What a controller has done since its last reset."""

    steps: int = 0
    clipped: int = 0
    """Samples in which the clipped unconstrained law stood in for the QP."""
    held: int = 0
    """Samples in which the input before was held."""
    worst_residual: float = 0.0
    """Largest KKT residual among the answers that were applied."""

    @property
    def fallbacks(self) -> int:
        """Samples in which the QP's answer was not applied."""
        return self.clipped + self.held


class Controller:
    """An MPC at work: measurement and reference in, tensions out, interpreted by CasADi.

    Made by :meth:`LinearMPC.controller`. It starts as after ``reset()``.

    Attributes
    ----------
    mpc, design
        What it was made from.
    info
        Counts of samples and fallbacks since the last reset.
    """

    def __init__(self, mpc: "LinearMPC", design: Design) -> None:
        self.mpc, self.design = mpc, design
        self._fallback = Buffered(control_law(mpc, design, with_qp=False))
        self.reset()
        self._law = self._build_law()

    def reset(self, u_prev: ArrayLike = 0.0) -> None:
        """Forget everything: the robot rests under the tensions ``u_prev``, N, a number or (m,)."""
        held = np.asarray(u_prev, dtype=float)
        if held.shape not in ((), (self.mpc.inputs,)) or not np.isfinite(held).all():
            raise ValueError(f"u_prev is a finite number or ({self.mpc.inputs},) of them, not {u_prev}")
        self._state = rest_state(self.mpc, self.design, np.broadcast_to(held, (self.mpc.inputs,)))
        self.info = ControllerInfo()

    @property
    def estimate(self) -> tuple[np.ndarray, np.ndarray]:
        """Estimated state (n,) and output disturbance (p,), m, at the last measurement."""
        n, p = len(self.design.A), self.mpc.outputs
        return self._state[:n].copy(), self._state[n : n + p].copy()

    def step(self, y: ArrayLike, reference: ArrayLike) -> np.ndarray:
        """Tensions (m,), N, for the coming sample.

        Parameters
        ----------
        y
            (p,) m, measured now, after the last tensions have been held for one sample.
        reference
            (p,) m, held over the horizon, or a preview (k, p) whose row 0 is wanted one sample from now; rows beyond
            the horizon are ignored, and the last row is held when there are fewer.

        Raises
        ------
        ValueError
            A shape does not fit, or a value is not finite; the controller's state is then left as it was.
        """
        measured = np.asarray(y, dtype=float)
        p, N = self.mpc.outputs, self.mpc.horizon
        if measured.shape != (p,):
            raise ValueError(f"y has shape {measured.shape}; this controller takes ({p},)")
        rows = np.asarray(reference, dtype=float)
        if rows.shape != (p,) and (rows.ndim != 2 or rows.shape[1] != p or not len(rows)):
            raise ValueError(f"reference has shape {rows.shape}; this controller takes ({p},) or a preview (k, {p})")
        if not np.isfinite(measured).all():
            raise ValueError(f"y must be finite, not {measured}")
        if not np.isfinite(rows).all():
            raise ValueError(f"reference must be finite, not {reference}")
        rows = np.atleast_2d(rows)
        preview = rows[np.minimum(np.arange(N), len(rows) - 1)]
        try:
            u, state, status, residual = self._law(measured, preview, self._state)
        except RuntimeError:
            # A solver may be beyond use after it gave up, so it is made anew.
            self._law = self._build_law()
            u, state, status, residual = self._fallback(measured, preview, self._state)
        self._state = state
        self.info.steps += 1
        self.info.clipped += int(status[0] == 1)
        self.info.held += int(status[0] == 2)
        if status[0] == 0:
            self.info.worst_residual = max(self.info.worst_residual, float(residual[0]))
        return u

    def _build_law(self) -> Buffered:
        # The first call belongs to the making: it sets the solver up, and qpOASES has its say.
        with quiet(self.mpc.backend == "qpoases"):
            law = Buffered(control_law(self.mpc, self.design))
            p, n, m = self.mpc.outputs, len(self.design.A), self.mpc.inputs
            law(np.zeros(p), np.zeros(self.mpc.horizon * p), np.zeros(n + p + m))
        return law
