from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import casadi as ca
import numpy as np

from .._quadrature import gauss_legendre
from ..body import Division, Section

_VARYING_POINTS = 12  # beyond what the basis needs, where section or stiffness vary along the division


def integral(division: Division, sectional: Callable[[float], ca.SX]) -> ca.SX:
    """Integral over a division of Phi' ``sectional``(x) Phi, (dof, dof).

    Exact for a polynomial basis on a uniform section. Stiffness and damping of a rod are such integrals, constant
    because the strain is linear in the coordinates.
    """
    strain = division.strain
    varies = not isinstance(division.section, Section) or callable(division.stiffness) or callable(division.damping)
    exact = all(type(basis).__name__ != "UserBasis" for _, basis in strain.bases)
    points = strain.degree + 1 + (0 if exact and not varies else _VARYING_POINTS)
    edges = [0.0, *strain.breaks, 1.0]
    nodes, weights = gauss_legendre(points)
    total = ca.SX(division.dof, division.dof)
    for a, b in pairwise(edges):
        x = a + (b - a) * nodes
        for at, weight, values in zip(x.tolist(), weights.tolist(), strain.tabulate(x), strict=True):
            basis = ca.DM(strain.sparsity, values)
            total += division.length * (b - a) * weight * (basis.T @ sectional(at) @ basis)
    return total


def spin_gram(divisions: tuple[Division, ...]) -> np.ndarray:
    """Matrix (n, n) whose quadratic form is the squared rotation, rad^2, that coordinates make along a rod.

    The integral of the squared angular strain, times the rod's length.
    """
    angular = ca.diag(ca.SX(ca.DM([1, 1, 1, 0, 0, 0])))
    length = sum(division.length for division in divisions)
    return length * ca.DM(ca.diagcat(*(integral(division, lambda x: angular) for division in divisions))).full()
