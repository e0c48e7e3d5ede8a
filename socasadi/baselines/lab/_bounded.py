import numpy as np
from numpy.typing import ArrayLike

from ...campaign import Pilot
from ...mpc import ControllerInfo, LinearMPC

_ROUNDING = 1e-6
"""Share of u_max by which an input may be beyond its bounds."""


def leeway(mpc: LinearMPC, held: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Least and largest input (m,), N, that an MPC's bounds and rate bounds allow after the one that was held (m,)."""
    lower, upper = mpc.input_limits
    if mpc.rate_limits is None:
        return lower, upper
    slowest, fastest = (held + limit * mpc.sample_time for limit in mpc.rate_limits)
    return np.clip(slowest, lower, upper), np.clip(fastest, lower, upper)


class Bounded:
    """A pilot that is held to the bounds and rate bounds of a study's MPC, whatever its own; a pilot itself.

    An input that leaves them, or is none, is a ValueError, which ends a flight as failed.
    """

    def __init__(self, pilot: Pilot, allowed: LinearMPC) -> None:
        self.mpc: LinearMPC = pilot.mpc
        self._pilot, self._allowed, self._held = pilot, allowed, np.zeros(allowed.inputs)

    @property
    def info(self) -> ControllerInfo:
        return self._pilot.info

    def reset(self, u_prev: ArrayLike = 0.0) -> None:
        self._pilot.reset(u_prev)
        self._held = np.broadcast_to(np.asarray(u_prev, dtype=float), (self._allowed.inputs,))

    def step(self, y: ArrayLike, reference: ArrayLike, disturbance: ArrayLike | None = None) -> np.ndarray:
        # A pilot may use its array again.
        u, allowed = np.array(self._pilot.step(y, reference, disturbance), dtype=float), self._allowed
        if u.shape != (allowed.inputs,) or not np.isfinite(u).all():
            raise ValueError(f"the controller gave {u!r} for its inputs; ({allowed.inputs},) finite numbers are needed")
        lower, upper = leeway(allowed, self._held)
        slack = _ROUNDING * allowed.input_scale
        if beyond := np.flatnonzero((u < lower - slack) | (u > upper + slack)).tolist():
            i = beyond[0]
            raise ValueError(
                f"the controller asks for {u[i]:.6g} N of input {i + 1}, for which the study's bounds leave "
                f"{lower[i]:.6g} to {upper[i]:.6g} N"
            )
        self._held = u
        return u
