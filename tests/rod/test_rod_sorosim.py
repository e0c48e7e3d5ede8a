"""Free fall of a clamped rod against SoRoSim, as that toolbox computed it itself.

The rod stands on its base, 0.6 m along the world's z, and is released under gravity (-9.81, -9.81, 0) m/s^2. The rows
are every 0.25 s of the trajectories of the tip that SoRoMoX published with its paper's results (MIT licence, 2025-2026
SoRoMoX contributors).
"""

import numpy as np
import pytest
from rod_support import CIRCLE, SILICONE, UPWARDS, values

from socasadi.rod import Division, Rod, Strain

CONSTANT = Strain(bending_y=0, bending_z=0, torsion=0, stretch=0, shear_y=0, shear_z=0)
LINEAR = Strain(bending_y=1, bending_z=1, stretch=1)

# x = y, and z, m
SPATIAL_PCS = [
    (-0.311390, 0.347033),
    (-0.343520, 0.030858),
    (-0.168299, 0.543305),
    (-0.210637, 0.505115),
    (-0.349845, 0.087752),
    (-0.293830, 0.385348),
    (-0.188560, 0.525538),
    (-0.340596, 0.238145),
    (-0.336519, 0.257652),
    (-0.222728, 0.491720),
    (-0.306346, 0.354852),
    (-0.342893, 0.221028),
]
COMPLEX_GVS = [
    (-0.318212, 0.360984),
    (-0.354480, -0.037837),
    (-0.215082, 0.509955),
    (-0.170091, 0.545200),
    (-0.373048, 0.112953),
    (-0.354118, 0.255983),
    (-0.181620, 0.536739),
    (-0.321745, 0.348651),
    (-0.369439, 0.134024),
    (-0.273573, 0.438240),
    (-0.259115, 0.457163),
    (-0.362709, 0.203072),
]


def falling(strain: Strain) -> Rod:
    half = Division(0.3, CIRCLE, SILICONE, strain)
    return Rod(divisions=(half, half), gravity=(-9.81, -9.81, 0.0), base_rotation=UPWARDS)


@pytest.mark.parametrize(
    ("strain", "rows", "within"),
    [(CONSTANT, SPATIAL_PCS, 2e-5), (LINEAR, COMPLEX_GVS, 1e-4)],
    ids=["spatial_pcs", "complex_gvs"],
)
def test_the_tip_falls_as_sorosims(strain, rows, within):
    rod = falling(strain)
    step = rod.step_expression(0.25, 0.0025)
    x = np.zeros(2 * rod.dof)
    assert np.allclose(values(rod.tip, x[: rod.dof]), [0, 0, 0.6], atol=1e-15)
    for horizontal, height in rows:
        x = values(step, x, [], np.zeros(3))
        tip = values(rod.tip, x[: rod.dof])
        assert np.linalg.norm(tip - [horizontal, horizontal, height]) < within


def test_the_stiffness_is_sorosims():
    """Its diagonal, as it is in print with the second trajectory, in the order of both divisions' coordinates.

    SoRoSim divides bases of angular strains by the division's length, so that its coordinates are 0.3 of these.
    """
    printed = np.array([2.1206, 0.7069, 2.1206, 0.7069, 848.23, 282.74])
    ours = np.diag(falling(LINEAR).stiffness.full()) / np.array([0.3**2] * 4 + [1.0] * 2 + [0.3**2] * 4 + [1.0] * 2)
    assert np.allclose(ours, np.tile(printed, 2), rtol=1e-4)
