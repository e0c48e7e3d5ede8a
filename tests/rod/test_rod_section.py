"""Sections, tapers and given stiffnesses against closed forms of the theory of beams."""

from dataclasses import replace

import numpy as np
import pytest
from rod_support import SILICONE, silicone_rod
from scipy.integrate import quad

from socasadi.rod import Cable, Division, Material, Rod, Section, Strain, Taper

STEEL = Material(young=2.1e11, poisson=0.3, density=7850.0)
BENDING = Strain(bending_y=2, bending_z=2)


def moments(inside, y, z, n=600):
    """Area, Iy = integral of z^2 and Iz = integral of y^2 by counting points of a fine grid."""
    ys, zs = (np.linspace(-half, half, 2 * n + 1)[1::2] for half in (y, z))
    Y, Z = np.meshgrid(ys, zs)
    cell = (2 * y / n) * (2 * z / n)
    kept = inside(Y, Z) * cell
    return kept.sum(), (kept * Z**2).sum(), (kept * Y**2).sum()


@pytest.mark.parametrize(
    ("section", "inside", "box"),
    [
        (Section.circle(0.03), lambda y, z: y**2 + z**2 < 0.03**2, (0.03, 0.03)),
        (Section.tube(0.03, 0.02), lambda y, z: (y**2 + z**2 < 0.03**2) & (y**2 + z**2 > 0.02**2), (0.03, 0.03)),
        (Section.ellipse(0.03, 0.01), lambda y, z: (y / 0.03) ** 2 + (z / 0.01) ** 2 < 1, (0.03, 0.01)),
        (Section.rectangle(0.06, 0.02), lambda y, z: y == y, (0.03, 0.01)),
    ],
    ids=["circle", "tube", "ellipse", "rectangle"],
)
def test_areas_and_moments(section, inside, box):
    assert np.allclose([section.area, section.Iy, section.Iz], moments(inside, *box), rtol=3e-3)
    assert section.Ix == section.Iy + section.Iz
    assert section.half_widths == box


def test_torsion_constants():
    assert pytest.approx(np.pi * 0.03**4 / 2, rel=1e-12) == Section.circle(0.03).J
    assert pytest.approx(np.pi * (0.03**4 - 0.02**4) / 2, rel=1e-12) == Section.tube(0.03, 0.02).J
    assert pytest.approx(np.pi * 0.03**3 * 0.01**3 / (0.03**2 + 0.01**2), rel=1e-12) == Section.ellipse(0.03, 0.01).J
    assert pytest.approx(Section.circle(0.02).J, rel=1e-12) == Section.ellipse(0.02, 0.02).J
    # Timoshenko and Goodier, art. 109, table: 0.1406 for a square, 0.229 for a ratio of 2, 0.312 of 10, then 1/3.
    assert pytest.approx(0.140577, rel=5e-6) == Section.rectangle(1.0, 1.0).J
    assert pytest.approx(0.22868, rel=5e-5) == Section.rectangle(2.0, 1.0).J / 2
    assert pytest.approx(0.31233, rel=5e-5) == Section.rectangle(10.0, 1.0).J / 10
    assert pytest.approx(1 / 3, rel=1e-4) == Section.rectangle(1e4, 1.0).J / 1e4
    assert pytest.approx(Section.rectangle(0.05, 0.02).J, rel=1e-7) == Section.rectangle(0.02, 0.05).J
    assert Section.circle(0.03, torsion_constant=1e-6).J == 1e-6
    assert Section(1.0, 2.0, 3.0).J == 5.0


def test_each_stiffness_is_what_a_load_meets():
    """P L / EA, M L / GJ, M L^2 / 2 EI about either axis, P L / GA with its correction."""
    section, L = Section(1e-4, 2e-9, 3e-9, torsion_constant=4e-9, shear_correction=0.8), 0.5
    every = Strain(bending_y=0, bending_z=0, torsion=0, stretch=0, shear_y=0, shear_z=0)
    rod = Rod(L, section, STEEL, every)
    E, G = 2.1e11, 2.1e11 / 2.6
    assert STEEL.shear_modulus == pytest.approx(G)
    assert rod.equilibrium(tip_force=(1, 0, 0)).q == pytest.approx([0, 0, 0, 1 / (E * 1e-4), 0, 0], rel=1e-9)
    for moment, stiffness in (((1e-3, 0, 0), G * 4e-9), ((0, 1e-3, 0), E * 2e-9), ((0, 0, 1e-3), E * 3e-9)):
        expected = np.concatenate([np.array(moment) / stiffness, np.zeros(3)])
        assert rod.equilibrium(tip_moment=moment).q == pytest.approx(expected, rel=1e-9, abs=1e-12)
    sheared = replace(rod, strain=Strain(shear_y=0, shear_z=0)).equilibrium(tip_force=(0, 1, 2)).q
    assert sheared == pytest.approx(np.array([1, 2]) / (0.8 * G * 1e-4), rel=1e-9)


def test_a_tapered_cantilever_deflects_as_the_integral_of_its_flexibility():
    """Circle from 0.03 m to 0.015 m: w = integral of P (L - s)^2 / (E I(s))."""
    L, P = 0.6, 1e-4
    division = Division(L, Taper("circle", 0.03, 0.015), SILICONE, Strain(bending_z=7))
    tip = Rod(divisions=division).equilibrium(tip_force=(0, P, 0)).tip[1]
    inertia = lambda s: np.pi / 4 * (0.03 - 0.015 * s / L) ** 4  # noqa: E731
    exact = quad(lambda s: P * (L - s) ** 2 / (1e6 * inertia(s)), 0, L, epsabs=0, epsrel=1e-12)[0]
    assert exact == pytest.approx(
        4 * P * L**3 / (3 * np.pi * 1e6 * 0.03**3 * 0.015), rel=1e-12
    )  # the same in closed form
    assert tip == pytest.approx(exact, rel=2e-5)


def test_a_tapered_rod_weighs_and_stretches_as_its_volume():
    L = 0.6
    rod = Rod(divisions=Division(L, Taper("circle", 0.03, 0.01), SILICONE, Strain(stretch=6)), gravity=(9.81, 0, 0))
    volume = np.pi * L / 3 * (0.03**2 + 0.03 * 0.01 + 0.01**2)
    top = -float(rod.energy(np.zeros(14))) / (1000 * 9.81 * volume)
    assert top == pytest.approx(L / 4 * (0.03**2 + 2 * 0.03 * 0.01 + 3 * 0.01**2) / (0.03**2 + 0.03 * 0.01 + 0.01**2))
    pulled = replace(rod, gravity=(0, 0, 0)).equilibrium(tip_force=(1, 0, 0)).tip[0] - L
    assert pulled == pytest.approx(L / (1e6 * np.pi * 0.03 * 0.01), rel=1e-4)


@pytest.mark.parametrize(
    ("shape", "base", "tip", "middle"),
    [
        ("tube", (0.03, 0.02), (0.02, 0.01), Section.tube(0.025, 0.015)),
        ("ellipse", (0.03, 0.02), (0.01, 0.02), Section.ellipse(0.02, 0.02)),
        ("rectangle", (0.03, 0.02), (0.01, 0.01), Section.rectangle(0.02, 0.015)),
    ],
)
def test_tapers_of_every_shape(shape, base, tip, middle):
    taper = Taper(shape, base, tip)
    assert taper(0.5).Iy == pytest.approx(middle.Iy)
    assert pytest.approx(middle.J) == taper(0.5).J
    own = Division(0.3, lambda x: taper(x), SILICONE, BENDING)
    assert np.allclose(
        Rod(divisions=own).stiffness.full(), Rod(divisions=Division(0.3, taper, SILICONE, BENDING)).stiffness.full()
    )


def test_a_section_of_ones_own_along_the_rod():
    """A bulge in the middle: area pi (r0 + r1 sin(pi x))^2."""
    bulge = lambda x: Section.circle(0.02 + 0.01 * float(np.sin(np.pi * x)))  # noqa: E731
    rod = Rod(divisions=Division(0.6, bulge, SILICONE, Strain(stretch=0)))
    area = np.pi * (0.02**2 + 2 * 0.02 * 0.01 * 2 / np.pi + 0.01**2 / 2)
    assert float(rod.stiffness) == pytest.approx(1e6 * area * 0.6, rel=1e-10)
    assert float(rod.damping_matrix) == pytest.approx(3e4 * area * 0.6, rel=1e-10)
    displaced = quad(lambda x: np.pi * (0.02 + 0.01 * np.sin(np.pi * x)) ** 2 * x**2, 0, 1)[0] * 0.6**3 * 1000
    assert float(rod.mass(0)) == pytest.approx(displaced, rel=1e-5)


def test_bend_twist_coupling():
    """A laminate [[GJ, K], [K, EI]]: a moment about z alone twists it by -K M / (GJ EI - K^2) per metre."""
    GJ, EI, K, M, L = 2.0, 3.0, 1.0, 0.2, 0.5
    stiffness = np.diag([GJ, 3.0, EI, 1e6, 1e6, 1e6])
    stiffness[0, 2] = stiffness[2, 0] = K
    division = Division(L, Section.circle(0.01), STEEL, Strain(torsion=0, bending_z=0), stiffness=stiffness)
    rod = Rod(divisions=division)
    assert np.allclose(rod.stiffness.full(), L * np.array([[GJ, K], [K, EI]]), rtol=1e-14)
    # A follower moment is uniform only about the axis that the helix keeps; for a small one that is z.
    twist, bend = rod.equilibrium(tip_moment=(0, 0, 1e-6 * M)).q / 1e-6
    assert twist == pytest.approx(-K * M / (GJ * EI - K**2), rel=1e-5)
    assert bend == pytest.approx(GJ * M / (GJ * EI - K**2), rel=1e-5)


def test_stiffness_and_damping_given_as_diagonals_or_along_the_rod():
    given = {"section": Section.circle(0.03), "material": SILICONE, "strain": Strain(bending_y=1, stretch=0)}
    diagonal = Rod(divisions=Division(0.4, **given, stiffness=(1, 2, 3, 4, 5, 6), damping=(6, 5, 4, 3, 2, 1)))
    assert np.allclose(diagonal.stiffness.full(), 0.4 * np.diag([2, 2 / 3, 4]))
    assert np.allclose(diagonal.damping_matrix.full(), 0.4 * np.diag([5, 5 / 3, 3]))
    growing = Rod(divisions=Division(0.4, **given, stiffness=lambda x: [1, 1 + x, 1, 2, 1, 1]))
    # Integrals of (1 + x) P_i P_j with P_0 = 1, P_1 = 2 x - 1.
    assert np.allclose(growing.stiffness.full(), 0.4 * np.array([[1.5, 1 / 6, 0], [1 / 6, 0.5, 0], [0, 0, 2]]))
    assert np.allclose(growing.damping_matrix.full(), silicone_rod(given["strain"], length=0.4).damping_matrix.full())


def test_damping_is_kelvin_voigts():
    """eta diag(Ix, 3 Iy, 3 Iz, 3 A, A, A)."""
    every = Strain(bending_y=0, bending_z=0, torsion=0, stretch=0, shear_y=0, shear_z=0)
    section = Section.ellipse(0.03, 0.02)
    rod = Rod(0.5, section, SILICONE, every)
    A = section.area
    expected = 0.5 * 1e4 * np.diag([section.Ix, 3 * section.Iy, 3 * section.Iz, 3 * A, A, A])
    assert np.allclose(rod.damping_matrix.full(), expected, rtol=1e-12)


def test_cables_in_a_section_are_told_from_those_outside(recwarn):
    rod = silicone_rod(BENDING, section=Section.rectangle(0.06, 0.06), cables=(Cable((0.029, 0.029)),))
    assert not recwarn
    assert not rod.divisions[0].section.contains(0.031, 0.0)
    with pytest.warns(UserWarning, match="outside the section"):
        replace(rod, section=Section.circle(0.03))
    with pytest.warns(UserWarning, match=r"s = 0\.\d+ m, outside"):
        Rod(divisions=Division(0.6, Taper("circle", 0.03, 0.01), SILICONE, BENDING), cables=(Cable((0.02, 0.0)),))


def test_a_short_cable_outside_is_warned_of():
    with pytest.warns(UserWarning, match="cable 1 runs at"):
        silicone_rod(BENDING, cables=(Cable((0.02, 0.0)), Cable((0.04, 0.0), start=0.1, end=0.2)))
