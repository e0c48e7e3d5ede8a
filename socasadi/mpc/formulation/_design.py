from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Self

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from ._dual import DualProgram, dual_program

SINGULAR = (
    "a matrix that the design inverts is singular, or its terminal cost or observer is not finite (a pole at 1, an "
    "unstable pole that the outputs do not show, inputs without any effect, or outputs without weight)"
)


class DesignError(ValueError):
    """A prediction model from which no controller can be made."""


@dataclass(frozen=True, eq=False)
class Design:
    r"""Numbers of one controller. Inputs are scaled, :math:`v = u / u_{max}`.

    The observer's state x holds the model's state, then, where inputs are delayed, the inputs of the last delay + 1
    samples, newest first, then the disturbance d (p,), m. With measured disturbances w,

    .. math:: x_+ = A x + B v + E w, \quad y = C x + D v + F w, \quad x \leftarrow x + K (y - C x - D v - F w),

    where v and w were held while y came about.

    The QP has the moves :math:`z = (v_0, v_1, ...)`, each held over a block of samples, and depends on the parameters
    p = (x, v before, reference row after row, w, 1):

    .. math::
        \min_z\; z'Hz/2 + (g p)'z + \sum_{soft} (c_i s_i + q_i s_i^2 / 2), \qquad
        l_i - s_i \le a_i z + b_i p \le u_i + s_i,\; s_i \ge 0,

    with :math:`s_i = 0` for hard rows. Rows are in this order: the box of every move, so that the first m rows are the
    first input itself; changes from move to move; outputs as shares of the largest output bound.
    """

    A: np.ndarray
    """(ne, ne)"""
    B: np.ndarray
    """(ne, m)"""
    E: np.ndarray
    """(ne, k)"""
    C: np.ndarray
    """(p, ne)"""
    D: np.ndarray
    """(p, m)"""
    F: np.ndarray
    """(p, k)"""
    gain: np.ndarray
    """(ne, p) Kalman gain K."""
    rest: np.ndarray
    """(ne, m) x at rest under a constant v, undisturbed."""
    hessian: np.ndarray
    """(nz, nz) H"""
    gradient: np.ndarray
    """(nz, np) g"""
    rows: np.ndarray
    """(nr, nz) a"""
    row_free: np.ndarray
    """(nr, np) b"""
    row_lower: np.ndarray
    """(nr,) l, infinite where there is no bound."""
    row_upper: np.ndarray
    """(nr,) u, infinite where there is no bound."""
    quadratic: np.ndarray
    """(nr,) q of soft rows; infinite: the row is hard."""
    price: np.ndarray
    """(nr,) c of soft rows, 0 for hard ones."""
    plausible: float
    """A measurement of this magnitude or more is taken for a fault of the sensor, m."""

    @classmethod
    def checked(cls, numbers: Sequence[ca.DM]) -> Self:
        """The design of evaluated outputs of :func:`design_function`; DesignError when it is none."""
        *arrays, plausible, residual = (np.asarray(value.full()) for value in numbers)
        arrays[-4:] = (array.ravel() for array in arrays[-4:])
        design = cls(*arrays, plausible.item())  # pyright: ignore[reportCallIssue]
        if not all(np.isfinite(array).all() for array in (*arrays[:-4], residual)):
            raise DesignError(f"the model gives no controller: {SINGULAR}")
        if residual.item() > 1e-6:
            raise DesignError(
                f"the model gives no controller: a Riccati equation is left with a residual of {residual.item():.1e} "
                "(the model cannot be stabilised or observed)"
            )
        radius = np.abs(np.linalg.eigvals(design.A - design.gain @ design.C @ design.A)).max()
        if radius >= 1:
            raise DesignError(f"the model gives no controller: its observer has a pole of magnitude {radius:.4f}")
        if np.linalg.eigvalsh(design.hessian)[0] <= 0:
            raise DesignError("the model gives no controller: the QP is not strictly convex")
        return design

    @property
    def order(self) -> int:
        """ne, of the observer."""
        return len(self.A)

    @property
    def inputs(self) -> int:
        """m"""
        return self.B.shape[1]

    @property
    def outputs(self) -> int:
        """p"""
        return len(self.C)

    @property
    def disturbances(self) -> int:
        """k, the measured ones."""
        return self.E.shape[1]

    @property
    def preview(self) -> int:
        """P, rows of the reference that are looked at."""
        rest = self.order + self.inputs + self.disturbances + 1
        return (self.gradient.shape[1] - rest) // self.outputs

    @cached_property
    def dual(self) -> DualProgram:
        """The QP as its rows see it."""
        names = ("hessian", "gradient", "rows", "row_free", "row_lower", "row_upper", "quadratic", "price")
        return dual_program(*(getattr(self, name) for name in names))

    @cached_property
    def law(self) -> np.ndarray:
        """(m, np) first input of the unconstrained problem."""
        return self.dual.map[: self.inputs] * self.dual.unit[: self.inputs, None]

    def parameters(self, x: ArrayLike, v: ArrayLike, reference: ArrayLike, w: ArrayLike = ()) -> np.ndarray:
        """Parameters p (np,) of the QP.

        Parameters
        ----------
        x
            (ne,) state of the observer.
        v
            (m,) scaled input before; taken at its bounds where it is beyond.
        reference
            (P, p) m, or the same row after row.
        w
            (k,) measured disturbances.

        Raises
        ------
        ValueError
            A number of values does not fit.
        """
        sizes = {
            "x": (x, self.order),
            "v": (v, self.inputs),
            "reference": (reference, self.preview * self.outputs),
            "w": (w, self.disturbances),
        }
        parts = {name: np.asarray(values, dtype=float).ravel() for name, (values, _) in sizes.items()}
        for name, (_, size) in sizes.items():
            if len(parts[name]) != size:
                raise ValueError(f"{name} has {len(parts[name])} values; this design takes {size}")
        parts["v"] = np.clip(parts["v"], self.row_lower[: self.inputs], self.row_upper[: self.inputs])
        return np.concatenate([*parts.values(), [1.0]])
