from typing import NamedTuple

import numpy as np

_GRID = 120
_CLOSE = 1e-10
_ROUNDS = 30


class Peak(NamedTuple):
    """Where a response over frequency is largest."""

    gain: float
    """Largest singular value there: the H-infinity norm. Infinite where the loop is not stable."""
    frequency: float
    """Hz; nan where the gain is infinite."""


def largest_gain(A: np.ndarray, B: np.ndarray, C: np.ndarray, D: np.ndarray) -> tuple[float, float]:
    r"""H-infinity norm of the stable discrete-time system (A, B, C, D), and the angle in [0, pi] at which it is taken.

    A lower bound from a grid is raised until the norm is met. With :math:`z = (1 + s) / (1 - s)` the system becomes one
    in continuous time of the same norm, whose Hamiltonian matrix has the eigenvalue :math:`j \omega` exactly where a
    singular value of the response equals the bound; between two such frequencies the response is larger (Boyd and
    Balakrishnan, Systems & Control Letters 15, 1990; Bruinsma and Steinbuch, ibid. 14, 1990). The imaginary parts of
    all its eigenvalues, and the middles between them, are tried, so that nothing hangs on which of them count as
    imaginary.
    """
    one = np.eye(len(A))

    def gains(angles: np.ndarray) -> np.ndarray:
        resolvent = np.exp(1j * angles)[:, None, None] * one - A
        return np.linalg.norm(C @ np.linalg.solve(resolvent, B.astype(complex)) + D, 2, axis=(1, 2))

    poles = np.abs(np.angle(np.linalg.eigvals(A)))
    angles = np.unique(np.concatenate([[0.0, np.pi], np.geomspace(1e-4 * np.pi, np.pi, _GRID), poles]))
    values = gains(angles)
    gain, angle = values.max(), angles[values.argmax()]

    halved = np.linalg.inv(A + one)
    Ac, Bc, Cc, Dc = halved @ (A - one), np.sqrt(2) * halved @ B, np.sqrt(2) * C @ halved, D - C @ halved @ B
    for _ in range(_ROUNDS):
        if gain == 0:
            break
        level = gain * (1 + _CLOSE)
        Cs, Ds = Cc / level, Dc / level
        inner = np.linalg.inv(np.eye(Ds.shape[1]) - Ds.T @ Ds)
        mixed = Ac + Bc @ inner @ Ds.T @ Cs
        outer = Cs.T @ (np.eye(len(Ds)) + Ds @ inner @ Ds.T) @ Cs
        hamiltonian = np.block([[mixed, Bc @ inner @ Bc.T], [-outer, -mixed.T]])
        crossings = np.unique(2 * np.arctan(np.abs(np.linalg.eigvals(hamiltonian).imag)))
        tried = np.concatenate([crossings, (crossings[1:] + crossings[:-1]) / 2])
        values = gains(tried)
        if values.max() <= level:
            break
        gain, angle = values.max(), tried[values.argmax()]
    return float(gain), float(angle)
