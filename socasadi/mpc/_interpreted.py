from typing import TYPE_CHECKING

import numpy as np

from ..codegen import Buffered
from ._controller import Controller, ControllerInfo
from ._law import control_law, rest_state
from .formulation import Design
from .solvers import quiet

if TYPE_CHECKING:
    from ._spec import LinearMPC


class InterpretedController(Controller):
    """The MPC as a CasADi Function, see :func:`control_law`, with one of CasADi's QP solvers."""

    def __init__(self, mpc: "LinearMPC", design: Design, backend: str) -> None:
        super().__init__(mpc, design)
        self._backend = backend
        self._fallback = Buffered(control_law(mpc, design, backend=backend, with_qp=False))
        self.reset()
        self._law = self._build_law()

    @property
    def info(self) -> ControllerInfo:
        return self._info

    @property
    def _observed(self) -> np.ndarray:
        return self._state[: len(self.design.A)]

    def _rest(self, u_prev: np.ndarray) -> None:
        self._state = rest_state(self.mpc, self.design, u_prev)
        self._info = ControllerInfo()

    def _advance(self, y: np.ndarray, reference: np.ndarray, w: np.ndarray) -> np.ndarray:
        try:
            u, state, status, residual, refused = self._law(y, reference, w, self._state)
        except RuntimeError:
            # A solver may be beyond use after it gave up, so it is made anew.
            self._law = self._build_law()
            u, state, status, residual, refused = self._fallback(y, reference, w, self._state)
        self._state, info = state, self._info
        info.steps += 1
        info.status, info.residual = int(status[0]), float(residual[0])
        info.clipped += info.status == 1
        info.held += info.status == 2
        info.refused += int(refused[0])
        if info.status == 0:
            info.worst_residual = max(info.worst_residual, info.residual)
        return u

    def _build_law(self) -> Buffered:
        # The first call belongs to the making: it sets the solver up, and qpOASES has its say.
        with quiet(self._backend == "qpoases"):
            law = Buffered(control_law(self.mpc, self.design, backend=self._backend))
            law(np.zeros(self._p), np.zeros(len(self._seen) * self._p), np.zeros(self._k), self._state)
        return law
