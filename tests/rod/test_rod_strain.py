"""Strain bases and divisions: what is one rod in two descriptions behaves as one."""

import casadi as ca
import numpy as np
import pytest
from rod_support import CIRCLE, SILICONE, coordinates, derivative, silicone_rod, slender, values
from scipy.interpolate import BSpline as ScipySpline
from scipy.special import fresnel

from socasadi.rod import (
    BSpline,
    Cable,
    DistributedLoad,
    Division,
    Legendre,
    Material,
    PointLoad,
    Rod,
    Section,
    Strain,
    UserBasis,
    piecewise_constant,
    piecewise_linear,
)

NAMES = ("torsion", "bending_y", "bending_z", "stretch", "shear_y", "shear_z")
LOADS = {"tip_force": (0.1, 0.4, -0.8), "tip_moment": (0.02, 0.01, 0.0)}


def functions(basis, x):
    strain = Strain(bending_z=basis)
    return np.array([strain.tabulate(np.array([place]))[0] for place in x])


def test_legendre_polynomials_are_those_of_numpy():
    x = np.linspace(0, 1, 11)
    assert np.allclose(functions(6, x), np.polynomial.legendre.legvander(2 * x - 1, 6), rtol=0, atol=1e-14)
    assert Strain(bending_z=Legendre(3)) == Strain(bending_z=3)


@pytest.mark.parametrize(("degree", "inner"), [(0, (0.25, 0.5)), (1, (0.3, 0.7)), (2, (0.5,)), (3, (0.2, 0.4, 0.9))])
def test_splines_are_those_of_scipy(degree, inner):
    x = np.linspace(0, 1, 41)
    knots = np.concatenate([np.zeros(degree + 1), inner, np.ones(degree + 1)])
    expected = ScipySpline.design_matrix(x, knots, degree).toarray()
    found = functions(BSpline(degree, inner), x)
    assert np.allclose(found, expected, rtol=0, atol=1e-14)
    assert np.allclose(found.sum(axis=1), 1, rtol=0, atol=1e-14)
    assert (found >= -1e-15).all()


def test_hats_are_one_at_their_own_knot():
    assert np.allclose(functions(piecewise_linear(4), np.linspace(0, 1, 5)), np.eye(5), rtol=0, atol=1e-15)
    assert np.array_equal(functions(piecewise_constant(3), [0.1, 0.5, 0.9]), np.eye(3))


def test_monomials_span_what_legendre_polynomials_span():
    monomials = UserBasis(tuple(lambda x, k=k: x**k for k in range(4)), degree=3)
    poses = [
        silicone_rod(Strain(bending_y=basis, bending_z=basis, torsion=0), quadrature_points=8).equilibrium(**LOADS)
        for basis in (3, monomials)
    ]
    assert np.allclose(poses[0].tip, poses[1].tip, rtol=0, atol=1e-11)
    assert poses[0].stability == pytest.approx(poses[1].stability, rel=1e-8)


def test_a_spline_without_inner_knots_is_a_polynomial():
    bases = (3, BSpline(3, 1))
    tips = [silicone_rod(Strain(bending_y=b, bending_z=b), quadrature_points=8).equilibrium(**LOADS).tip for b in bases]
    assert np.allclose(tips[0], tips[1], rtol=0, atol=1e-11)


def test_a_users_cosines_hold_a_curvature_that_they_can_make():
    """EI kappa = m(s): a distributed moment whose integral from the tip is 1 + cos(pi s) bends exactly so."""
    basis = UserBasis((lambda x: 1, lambda x: ca.cos(ca.pi * x)), degree=9)
    turning = DistributedLoad(moment=lambda s: (0, 0, np.pi * np.sin(np.pi * s)))
    rod = slender(Strain(bending_z=basis), loads=(turning,), quadrature_points=14)
    assert rod.equilibrium().q == pytest.approx([1, 1], abs=1e-5)


@pytest.mark.parametrize("name", NAMES)
def test_each_strain_alone(name):
    """A constant strain of any kind is an exact pose: an arc, a twist, a stretch or a slide."""
    rod = silicone_rod(Strain(**{name: 0}))
    amount = 0.5 if name in NAMES[:3] else 0.1
    pose = values(rod.pose, [amount], 0.6)
    angle, L = amount * 0.6, 0.6
    arc = np.array([np.sin(angle), 1 - np.cos(angle)]) / amount
    expected = {
        "torsion": (L, 0, 0),
        "bending_y": (arc[0], 0, -arc[1]),
        "bending_z": (arc[0], arc[1], 0),
        "stretch": (1.1 * L, 0, 0),
        "shear_y": (L, 0.1 * L, 0),
        "shear_z": (L, 0, 0.1 * L),
    }[name]
    assert np.allclose(pose[:3, 3], expected, rtol=0, atol=1e-15)
    if name == "torsion":
        turned = [[1, 0, 0], [0, np.cos(angle), -np.sin(angle)], [0, np.sin(angle), np.cos(angle)]]
        assert np.allclose(pose[:3, :3], turned, rtol=0, atol=1e-15)
    assert values(rod.model.strain, [amount], 0.3)[NAMES.index(name)] == amount + (name == "stretch")


@pytest.mark.parametrize("free", [NAMES[:1], NAMES[1:3], NAMES[::2], NAMES], ids=len)
def test_any_subset_of_strains_moves(free):
    rod = silicone_rod(Strain(**dict.fromkeys(free, 1)), gravity=(1, 2, 3))
    assert rod.dof == 2 * len(free)
    assert np.isfinite(values(rod.rhs, np.full(2 * rod.dof, 0.01), np.zeros(0))).all()


def test_coordinates_are_ordered_as_documented():
    rod = silicone_rod(Strain(shear_z=0, stretch=1, torsion=0, bending_z=piecewise_constant(2), bending_y=0))
    strain = values(rod.model.strain, [1, 2, 3, 4, 5, 6, 7], 0.15)
    assert np.allclose(strain, [1, 2, 3, 1 + 5 + 6 * (2 * 0.25 - 1), 0, 7])
    assert values(rod.model.strain, [1, 2, 3, 4, 5, 6, 7], 0.45)[2] == 4


def test_pieces_of_constant_strain_are_divisions_of_constant_strain():
    pieces = 3
    constant = dict.fromkeys(NAMES, 0)
    part = Division(0.2, CIRCLE, SILICONE, Strain(**constant), quadrature_points=4)
    chain = Rod(divisions=(part,) * pieces, gravity=(0, 0, -9.81))
    strain = Strain(**dict.fromkeys(NAMES, piecewise_constant(pieces)))
    rod = silicone_rod(strain, gravity=(0, 0, -9.81), quadrature_points=4)
    order = np.arange(18).reshape(6, 3).T.ravel()  # strain by strain, as division by division
    q, v = coordinates(rod), coordinates(rod, 1)
    x = np.concatenate([q, v])
    mass = values(rod.mass, q)
    assert np.allclose(values(chain.mass, q[order]), mass[np.ix_(order, order)], rtol=0, atol=1e-15)
    rate = values(rod.rhs, x, [])
    both = np.concatenate([order, 18 + order])
    assert np.allclose(values(chain.rhs, x[both], []), rate[both], rtol=0, atol=1e-9 * np.abs(rate).max())
    assert np.allclose(chain.equilibrium(**LOADS).tip, rod.equilibrium(**LOADS).tip, rtol=0, atol=1e-12)


def test_a_rod_cut_in_two_behaves_as_one():
    """A polynomial of the whole rod is one polynomial in each half: there is a matrix between the coordinates."""
    degree, points = 2, 12
    whole = silicone_rod(Strain(bending_y=degree, bending_z=degree), gravity=(1, 2, 3), quadrature_points=points)
    part = Division(0.3, CIRCLE, SILICONE, whole.divisions[0].strain, quadrature_points=points)
    halves = Rod(divisions=(part, part), gravity=(1, 2, 3), cables=(Cable((0.02, 0.0)), Cable((0, 0.02), end=0.4)))
    fit = np.linalg.pinv(np.polynomial.legendre.legvander(np.linspace(-1, 1, 9), degree))
    blocks = [fit @ np.polynomial.legendre.legvander(np.linspace(a, a + 1, 9), degree) for a in (-1.0, 0.0)]
    across = np.vstack([np.kron(np.eye(2), block) for block in blocks])
    q, v = coordinates(whole), coordinates(whole, 1)
    assert np.allclose(values(halves.tip, across @ q), values(whole.tip, q), rtol=0, atol=5e-7)
    reduced = across.T @ values(halves.mass, across @ q) @ across
    assert np.allclose(reduced, values(whole.mass, q), rtol=0, atol=2e-6 * np.abs(reduced).max())
    bias = values(whole.bias, q, v)
    assert np.allclose(
        across.T @ values(halves.bias, across @ q, across @ v), bias, rtol=0, atol=1e-5 * np.abs(bias).max()
    )
    assert np.allclose(across.T @ halves.stiffness.full() @ across, whole.stiffness.full(), rtol=1e-12, atol=1e-15)
    single = Rod(divisions=whole.divisions, cables=halves.cables)
    for name in ("actuation", "cable_lengths"):
        expected, found = values(getattr(single.model, name), q), values(getattr(halves.model, name), across @ q)
        found = across.T @ found if name == "actuation" else found
        assert np.allclose(found, expected, rtol=0, atol=1e-9)


def test_an_arm_of_two_radii_deflects_as_beams_in_series():
    thick, thin, a, b, P = CIRCLE, Section.circle(0.02), 0.4, 0.3, 1e-4
    free = Strain(bending_y=1, bending_z=1)
    arm = Rod(divisions=(Division(a, thick, SILICONE, free), Division(b, thin, SILICONE, free)))
    EI = [1e6 * section.Iy for section in (thick, thin)]
    # Integral of (L - s)^2 / EI along the arm.
    deflection = P * (((a + b) ** 3 - b**3) / (3 * EI[0]) + b**3 / (3 * EI[1]))
    assert arm.equilibrium(tip_force=(0, 0, P)).tip[2] == pytest.approx(deflection, rel=1e-6)
    assert arm.length == pytest.approx(0.7)
    joint = values(arm.pose, arm.equilibrium(tip_force=(0, 0, P)).q, a)[2, 3]
    assert joint == pytest.approx(P * (a**3 / 3 + a**2 * b / 2) / EI[0], rel=1e-6)


def test_divisions_with_bases_materials_and_points_of_their_own():
    stiff = Division(0.2, CIRCLE, Material(1e8, 0.3, 2000), Strain(torsion=0), quadrature_points=3)
    soft = Division(0.4, CIRCLE, SILICONE, Strain(bending_z=piecewise_linear(2), stretch=1))
    rod = Rod(divisions=(stiff, soft))
    assert rod.dof == 1 + 3 + 2
    GJ, EI, EA = 1e8 / 2.6 * CIRCLE.J, 1e6 * CIRCLE.Iz, 1e6 * CIRCLE.area
    hats = 0.4 / 2 / 6 * EI * np.array([[2, 1, 0], [1, 4, 1], [0, 1, 2]])
    expected = np.zeros((6, 6))
    expected[0, 0], expected[1:4, 1:4] = 0.2 * GJ, hats
    expected[4:, 4:] = np.diag([0.4 * EA, 0.4 * EA / 3])
    assert np.allclose(rod.stiffness.full(), expected, rtol=1e-12, atol=1e-12)


def test_a_curved_rod_without_loads_stays_as_it_was_made():
    coil = Strain(bending_y=1, bending_z=1, torsion=1, rest=(2.0, 1.0, 8.0, 1.0, 0.0, 0.0))
    rod = silicone_rod(coil, quadrature_points=30)
    assert np.array_equal(rod.equilibrium().q, np.zeros(6))
    assert np.array_equal(values(rod.rhs, np.zeros(12), []), np.zeros(12))
    # A helix of curvature kappa and torsion tau, of which constant strain makes one exactly.
    kappa, tau = np.hypot(1, 8), 2.0
    turn = np.hypot(kappa, tau)
    chord = 2 * kappa / turn**2 * np.sin(0.6 * turn / 2)
    rise = 0.6 * tau / turn
    assert np.linalg.norm(rod.equilibrium().tip) == pytest.approx(np.hypot(chord, rise), rel=1e-13)


def test_a_pretwisted_blade_bends_in_both_planes():
    """A quarter turn of twist from base to tip, a small dead load: the beam's curvature integrated in world axes."""
    L, rate, P = 0.6, np.pi / 2 / 0.6, 1e-5
    strain = Strain(bending_y=8, bending_z=8, rest=(rate, 0, 0, 1, 0, 0))
    blade = Rod(L, Section.rectangle(0.02, 0.005), SILICONE, strain, quadrature_points=30)
    Iy, Iz = 0.02 * 0.005**3 / 12, 0.02**3 * 0.005 / 12
    s, w = np.polynomial.legendre.leggauss(30)
    s, w = L / 2 * (s + 1), L / 2 * w
    c, n = np.cos(rate * s), np.sin(rate * s)
    moment = np.array([-P * (L - s), 0 * s])  # of a force along world z, about world y and z
    local = np.array([c * moment[0] + n * moment[1], -n * moment[0] + c * moment[1]]) / 1e6 / np.array([[Iy], [Iz]])
    world = np.array([c * local[0] - n * local[1], n * local[0] + c * local[1]])
    y, z = (w * (L - s) * world[1]).sum(), -(w * (L - s) * world[0]).sum()
    assert np.allclose(blade.equilibrium(tip_force=(0, 0, P)).tip[1:], [y, z], rtol=1e-4, atol=0)
    assert abs(y) > 0.1 * abs(z)


def test_a_clothoid_is_fresnels():
    """A rest curvature that grows with arc length: x and y are Fresnel's integrals."""
    L, growth = 0.6, 20.0
    spiral = Strain(bending_z=1, rest=lambda x: (0, 0, growth * L * x, 1, 0, 0))
    rod = silicone_rod(spiral, quadrature_points=40)
    unit = np.sqrt(np.pi / growth)
    y, x = fresnel(L / unit)
    assert np.allclose(rod.equilibrium().tip, [unit * x, unit * y, 0], rtol=0, atol=2e-7)
    assert np.allclose(values(rod.model.strain, [0, 0], 0.3), [0, 0, growth * 0.3, 1, 0, 0], atol=1e-12)
    # It is what the free coordinates would make: 12 x = 6 + 6 P_1(2 x - 1).
    straight = silicone_rod(Strain(bending_z=1), quadrature_points=40)
    assert np.allclose(rod.equilibrium().tip, values(straight.tip, [6, 6]), rtol=0, atol=1e-13)
    bent = [values(r.mass, q) for r, q in ((rod, [0.5, -0.2]), (straight, [6.5, 5.8]))]
    assert np.allclose(bent[0], bent[1], rtol=0, atol=1e-13)


def test_dependence_of_the_tip_on_a_load_in_the_first_of_two_divisions():
    """What lies beyond a load stays straight, and follows."""
    part = Division(0.3, CIRCLE, SILICONE, Strain(bending_z=2))
    rod = Rod(divisions=(part, part), loads=(PointLoad((0, 0.01, 0), s=0.3),))
    equilibrium = rod.equilibrium()
    assert np.allclose(equilibrium.q[3:], 0, atol=1e-15)
    EI = 1e6 * CIRCLE.Iz
    deflection = 0.01 * (0.3**3 / 3 + 0.3**2 / 2 * 0.3) / EI
    assert equilibrium.tip[1] == pytest.approx(deflection, rel=1e-4)
    assert np.allclose(derivative(lambda q: values(rod.tip, q), equilibrium.q)[2], 0, atol=1e-12)
