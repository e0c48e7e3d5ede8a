import numpy as np
from scipy.linalg import schur

from ._loop import decays

OBSERVABLE = 1e-6
"""A measure below this is that of something that cannot be observed."""


def observability(A: np.ndarray, C: np.ndarray, memory: int) -> float:
    r"""How well the states can be told from the outputs, from 0 to 1: a condition number of the observability matrix.

    The smallest over the largest singular value of the matrix of all :math:`C (A / \alpha)^k` whose columns are scaled
    to length 1. Each state is so counted in the unit in which it moves the outputs as much as any other, which is what
    keeps the units of states from deciding; and it is more than a test of rank at the poles, since it tells how alike
    two states look. :math:`\alpha`, which leaves observability as it is, makes old outputs fade over ``memory``
    samples, and faster than any mode grows.
    """
    fade = max(1.0, float(np.abs(np.linalg.eigvals(A)).max())) * np.exp(1 / memory)
    rows = [C]
    for _ in range(max(4 * memory, len(A)) - 1):
        rows.append(rows[-1] @ A / fade)
    matrix = np.vstack(rows)
    lengths = np.linalg.norm(matrix, axis=0)
    if (lengths == 0).any():
        return 0.0
    values = np.linalg.svd(matrix / lengths, compute_uv=False)
    return float(values[-1] / values[0])


def unstable_part(A: np.ndarray, B: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(A, C) of the dual of the modes that do not decay: they can be stabilised where it can be observed."""
    triangle, vectors, count = schur(A.T, output="complex", sort=lambda pole: not decays(abs(pole)))  # pyright: ignore
    return triangle[:count, :count], B.T @ vectors[:, :count]
