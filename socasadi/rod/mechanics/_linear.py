from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import casadi as ca
import numpy as np
from scipy.linalg import eigh, expm

from .._checks import positive_number
from ._model import TIP_LOADS

if TYPE_CHECKING:
    from .._rod import Rod
    from ._statics import Equilibrium


@dataclass(frozen=True, eq=False)
class Linearisation:
    """Deviations from an equilibrium: dx/dt = A x + B u (or x+ = A x + B u), y = C x + D u.

    Attributes
    ----------
    A, B, C, D
        Matrices (2 n, 2 n), (2 n, cables), (outputs, 2 n), (outputs, cables): state [q; v]; tensions in N, or the
        other inputs that cables and chambers take; the tip's (y, z) in m, base frame, unless another output was given.
    sample_time
        s; None for continuous time.
    equilibrium
        Where the deviations start from.
    """

    A: np.ndarray
    B: np.ndarray
    C: np.ndarray
    D: np.ndarray
    sample_time: float | None
    equilibrium: Equilibrium

    def __iter__(self):
        """A, B, C, D = linearisation"""
        return iter((self.A, self.B, self.C, self.D))


@dataclass(frozen=True, eq=False)
class Modes:
    """Small vibrations about an equilibrium, slowest first.

    Attributes
    ----------
    frequency
        Undamped natural frequencies (n,), Hz; 0 where the equilibrium is not stable.
    damping_ratio
        (n,), of the material and of linear drag; above 1 the mode is overdamped. Modal damping: the coupling between
        modes is left out.
    shape
        (n, n) mode shapes in the strain coordinates, one a column, of unit modal mass.
    """

    frequency: np.ndarray
    damping_ratio: np.ndarray
    shape: np.ndarray


def linearise(
    rod: Rod, equilibrium: Equilibrium, sample_time: float | None, output: ca.Function | None
) -> Linearisation:
    n, m = rod.dof, len(rod.cables)
    x, u, tip = ca.MX.sym("x", 2 * n), ca.MX.sym("u", m), ca.MX.sym("tip", TIP_LOADS)
    if output is None:
        y = (ca.DM(rod.base_rotation).T @ rod.tip(x[:n]))[1:]
    elif isinstance(output, ca.Function) and output.n_in() == 1 and output.size_in(0) == (2 * n, 1):
        y = output(x)
    else:
        raise ValueError(f"Rod.linearise: output is {output}, but must be a CasADi Function of the state x ({2 * n},)")
    xdot = rod.model.loaded_rhs(x, u, tip)
    jacobians = [ca.jacobian(xdot, x), ca.jacobian(xdot, u), ca.jacobian(y, x)]
    evaluate = ca.Function("linear", [x, u, tip], jacobians)
    A, B, C = (value.full() for value in evaluate(equilibrium.state, equilibrium.input, equilibrium.tip_load))
    if sample_time is not None:
        positive_number("Rod.linearise", sample_time=sample_time)
        both = expm(sample_time * np.block([[A, B], [np.zeros((m, 2 * n + m))]]))
        A, B = both[: 2 * n, : 2 * n], both[: 2 * n, 2 * n :]
    return Linearisation(A, B, C, np.zeros((C.shape[0], m)), sample_time, equilibrium)


def modes(rod: Rod, tangent: np.ndarray, q: np.ndarray) -> Modes:
    """Modes of the conservative part of ``tangent`` stiffness with the mass matrix at ``q``."""
    squared, shape = eigh((tangent + tangent.T) / 2, rod.mass(q).full())
    omega = np.sqrt(np.maximum(squared, 0))
    at_rest = np.concatenate([q, np.zeros_like(q)])
    drag = ca.tril2symm(rod.model.motion(at_rest, np.zeros(len(rod.cables)))[3])
    damping = np.einsum("ij,ik,kj->j", shape, (rod.damping_matrix + drag).full(), shape)
    with np.errstate(divide="ignore", invalid="ignore"):
        return Modes(omega / (2 * np.pi), damping / (2 * omega), shape)
