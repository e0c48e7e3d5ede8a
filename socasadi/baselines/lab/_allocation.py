import numpy as np

_EFFORT = 1e-5
"""Weight of the inputs beside the outputs', as a share of the largest gain: it chooses among those as near, no more."""
_REACHED = 1e-4
"""Share of what is wanted by which it may be missed and counts as reached."""


class Allocation:
    """Which inputs hold the outputs at wanted values.

    Parameters
    ----------
    gain
        How outputs at rest depend on inputs that are held, (p, m).
    """

    def __init__(self, gain: np.ndarray) -> None:
        self.gain, self.inverse = gain, np.linalg.pinv(gain)

    def inputs(self, wanted: np.ndarray, allowed: tuple[np.ndarray, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
        """The smallest inputs (m,) within bounds whose outputs at rest come as near as can be to those wanted (p,).

        And what bounds make them miss (p,): zero where they do not.
        """
        u, (lower, upper) = self.inverse @ wanted, allowed
        if not np.isfinite(u).all() or ((lower <= u) & (u <= upper)).all():
            return u, np.zeros(len(wanted))
        from scipy.optimize import lsq_linear  # takes its time to import

        free, u = lower < upper, np.where(lower < upper, 0.0, lower)
        rows = np.vstack([self.gain, _EFFORT * np.linalg.norm(self.gain, 2) * np.eye(len(u))])
        if free.any():
            target = np.concatenate([wanted, np.zeros(len(u))]) - rows @ u
            u[free] = lsq_linear(rows[:, free], target, (lower[free], upper[free]), method="bvls").x
        missed = wanted - self.gain @ u
        return u, np.where(np.abs(missed) > _REACHED * np.linalg.norm(wanted), missed, 0.0)
