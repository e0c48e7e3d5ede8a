from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from ..model import StateSpace
from .analysis import Analysis, analyse
from .formulation import Design

if TYPE_CHECKING:
    from ._spec import LinearMPC


@dataclass
class ControllerInfo:
    """What a controller has done since its last reset."""

    status: int = 0
    """Of the last sample: 0, the QP's answer; 1, the clipped unconstrained law; 2, the input before."""
    iterations: int = 0
    """Of the QP in the last sample; 0 where the solver does not tell."""
    residual: float = 0.0
    """KKT residual of the last answer of the QP."""
    steps: int = 0
    clipped: int = 0
    """Samples in which the clipped unconstrained law stood in for the QP."""
    held: int = 0
    """Samples in which the input before was held."""
    refused: int = 0
    """Samples whose measurement could not be and corrected nothing."""
    worst_iterations: int = 0
    worst_residual: float = 0.0
    """Largest KKT residual among the answers that were applied."""

    @property
    def fallbacks(self) -> int:
        """Samples in which the QP's answer was not applied."""
        return self.clipped + self.held


class Controller(ABC):
    """An MPC at work: measurement and reference in, tensions out.

    Made by :meth:`LinearMPC.controller`: :class:`CompiledController` is the C that is exported,
    :class:`InterpretedController` the same mathematics as a CasADi Function with one of CasADi's QP solvers. It starts
    as after ``reset()``.

    Attributes
    ----------
    mpc, design
        What it was made from.
    """

    def __init__(self, mpc: "LinearMPC", design: Design) -> None:
        self.mpc, self.design = mpc, design
        self._p, self._m, self._k = mpc.outputs, mpc.inputs, mpc.measured_disturbances
        self._seen = np.arange(mpc.reference_rows)

    @property
    @abstractmethod
    def info(self) -> ControllerInfo:
        """Counts of samples, iterations and fallbacks since the last reset."""

    @property
    @abstractmethod
    def _observed(self) -> np.ndarray:
        """The observer's state."""

    @abstractmethod
    def _rest(self, u_prev: np.ndarray) -> None: ...

    @abstractmethod
    def _advance(self, y: np.ndarray, reference: np.ndarray, w: np.ndarray) -> np.ndarray: ...

    def reset(self, u_prev: ArrayLike = 0.0) -> None:
        """Forget everything: the robot rests under the tensions ``u_prev``, N, a number or (m,).

        They may be out of the bounds, if the robot is; the next ones are inside, whatever the rate bounds.
        """
        held = _numbers("u_prev", u_prev)
        if held.shape not in ((), (self._m,)) or not np.isfinite(held).all():
            raise ValueError(f"u_prev is a finite number or ({self._m},) of them, not {u_prev}")
        self._rest(np.broadcast_to(held, (self._m,)).copy())

    @property
    def estimate(self) -> tuple[np.ndarray, np.ndarray]:
        """Estimated state (n,) of the prediction model and disturbance (p,), m, at the last measurement."""
        state, delay = self._observed, self.mpc.delay
        on_their_way = (delay + 1) * self._m if delay else 0
        d = len(state) - self._p
        return state[: d - on_their_way].copy(), state[d:].copy()

    def analysis(self, plant: StateSpace | None = None) -> Analysis:
        """Poles, margins and worst-case gains of the loop while no bound is active; printed, it is a page.

        Parameters
        ----------
        plant
            What the controller is thought to meet, by default its own prediction model. Its inputs are this MPC's, in
            newtons; where the MPC counts on a delay the plant has it, too.
        """
        return analyse(self.mpc, self.design, plant)

    def step(self, y: ArrayLike, reference: ArrayLike, disturbance: ArrayLike | None = None) -> np.ndarray:
        """Tensions (m,), N, for the coming sample.

        Parameters
        ----------
        y
            (p,) m, measured now, after the last tensions have been held for one sample.
        reference
            (p,) m, held over the horizon, or a preview (k, p) whose row 0 is wanted one sample from now; rows beyond
            ``mpc.preview`` are ignored, and the last row is held when there are fewer.
        disturbance
            Measured disturbances now, taken to stay; of an MPC that has any, (``mpc.measured_disturbances``,).

        Raises
        ------
        ValueError
            A shape does not fit, or a value is not finite; the controller's state is then left as it was.
        """
        measured = _numbers("y", y)
        if measured.shape != (self._p,):
            raise ValueError(f"y has shape {measured.shape}; this controller takes ({self._p},)")
        if not np.isfinite(measured).all():
            raise ValueError(f"y must be finite, not {measured}")
        rows = _numbers("reference", reference)
        if rows.shape != (self._p,) and (rows.ndim != 2 or rows.shape[1] != self._p or not len(rows)):
            raise ValueError(
                f"reference has shape {rows.shape}; this controller takes ({self._p},) or a preview (k, {self._p})"
            )
        if not np.isfinite(rows).all():
            raise ValueError(f"reference must be finite, not {reference}")
        rows = np.atleast_2d(rows)
        preview = rows[np.minimum(self._seen, len(rows) - 1)]
        return self._advance(measured, preview, self._measured_disturbance(disturbance))

    def _measured_disturbance(self, disturbance: ArrayLike | None) -> np.ndarray:
        if disturbance is None and self._k:
            raise ValueError(f"this controller takes ({self._k},) measured disturbances beside y and the reference")
        values = np.zeros(0) if disturbance is None else _numbers("disturbance", disturbance)
        if values.size and not self._k:
            raise ValueError(f"this controller takes no measured disturbances, and was told {disturbance}")
        if values.shape != (self._k,) or not np.isfinite(values).all():
            raise ValueError(f"disturbance is ({self._k},) finite numbers, not {disturbance}")
        return values


def _numbers(name: str, values: ArrayLike) -> np.ndarray:
    try:
        return np.asarray(values, dtype=float)
    except (TypeError, ValueError):
        raise ValueError(f"{name} is numbers, not {values!r}") from None
