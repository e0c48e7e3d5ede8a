"""What several tests of the rod share: rods, and numerical derivatives."""

import casadi as ca
import numpy as np

from socasadi.rod import (
    Cable,
    Chamber,
    Converging,
    DistributedLoad,
    Division,
    Drag,
    Helix,
    Material,
    Payload,
    PointLoad,
    Rod,
    Section,
    Strain,
    Taper,
    piecewise_linear,
)

SILICONE = Material(young=1e6, poisson=0.5, density=1000.0, damping=1e4)
CIRCLE = Section.circle(0.03)
UPWARDS = ((0.0, 0.0, -1.0), (0.0, 1.0, 0.0), (1.0, 0.0, 0.0))
"""A base whose x axis, and the rod with it, points along the world's z."""


def silicone_rod(strain: Strain, **changes) -> Rod:
    """0.6 m of silicone, 0.03 m in radius."""
    return Rod(**{"length": 0.6, "section": CIRCLE, "material": SILICONE, "strain": strain} | changes)


def slender(strain: Strain, **changes) -> Rod:
    """L = 1, EI = 1, inextensible: loads are numbers without units."""
    section = Section(area=1e6, Iy=1.0, Iz=1.0)
    return Rod(**{"length": 1.0, "section": section, "material": Material(1.0, 0.5, 1.0), "strain": strain} | changes)


def rich_rod(**changes) -> Rod:
    """A rod with something of everything: two divisions, payloads, loads, drag, rubbing and winding cables."""
    lower = Strain(bending_y=1, bending_z=1, torsion=0, stretch=0, rest=lambda x: (0.3, 0.2 * x, 0.5, 1.0, 0.0, 0.0))
    upper = Strain(
        bending_y=1, bending_z=piecewise_linear(2), torsion=0, shear_y=0, rest=(0.0, 0.4, 0.0, 1.0, 0.0, 0.0)
    )
    given = {
        "divisions": (
            Division(0.3, Taper("circle", 0.03, 0.025), SILICONE, lower),
            Division(0.3, Section.ellipse(0.025, 0.02), SILICONE, upper),
        ),
        "cables": (
            Cable(Helix(0.015, 0.4)),
            Cable(Converging((0.02, 0.0), (0.01, 0.0), 0.6), friction=0.2),
            Cable((0.0, -0.015), end=0.4),
            Chamber((0.0, 0.01), 1e-4, start=0.1),
        ),
        "gravity": (1.0, -2.0, -9.0),
        "base_rotation": UPWARDS,
        "base_position": (0.1, -0.2, 0.3),
        "payloads": (
            Payload(0.03, s=0.2, inertia=(1e-5, 2e-5, 3e-5), offset=(0.01, 0.02, -0.01)),
            Payload(0.02, offset=(0.02, 0.0, 0.01)),
        ),
        "loads": (
            PointLoad((0.0, 0.1, 0.05), (0.0, 0.0, 0.01), s=0.35, follower=True),
            PointLoad((0.1, 0.0, 0.02), (0.01, 0.0, 0.0)),
            DistributedLoad(lambda s: (0.0, s, 0.1), start=0.1, end=0.5),
        ),
        "drag": Drag((0.1, 0.3), (1.0, 4.0), (0.001, 0.002)),
    }
    return Rod(**given | changes)


def coordinates(rod: Rod, seed: int = 0, size: float = 0.7) -> np.ndarray:
    """Random strain coordinates (n,), those of stretch and shear a tenth of the curvatures."""
    rows = np.concatenate([division.strain.rows for division in rod.divisions])
    return size * np.random.default_rng(seed).normal(size=rod.dof) * np.where(rows < 3, 1.0, 0.1)


def values(function: ca.Function, *arguments) -> np.ndarray:
    """The first output as an array, a column as a vector."""
    result = function(*arguments)
    array = (result[0] if isinstance(result, tuple) else result).full()
    return array[:, 0] if array.shape[1] == 1 else array


def derivative(function, x, h: float = 1e-4, order: int = 4) -> np.ndarray:
    """Central differences of ``function`` at ``x``, of order two or four: (*shape of a value, len(x))."""
    x = np.asarray(x, dtype=float)

    def change(step):
        return np.asarray(function(x + step)) - np.asarray(function(x - step))

    if order == 2:
        return np.stack([change(h * e) / (2 * h) for e in np.eye(len(x))], axis=-1)
    return np.stack([(8 * change(h * e) - change(2 * h * e)) / (12 * h) for e in np.eye(len(x))], axis=-1)
