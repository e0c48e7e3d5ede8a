"""Derivatives with respect to state, input, place and parameters against finite differences, at rest and far away."""

import casadi as ca
import numpy as np
import pytest
from rod_support import CIRCLE, SILICONE, coordinates, derivative, rich_rod, silicone_rod, values

from socasadi.rod import Cable, Drag, Helix, Material, Payload, PointLoad, Rod, Section, Strain

FREE = Strain(bending_y=1, bending_z=1, torsion=1, stretch=0)
CABLES = (Cable((0.02, 0.0)), Cable(Helix(0.02, 0.5), friction=0.1))  # a straight cable's friction has a kink at zero
ROD = silicone_rod(FREE, cables=CABLES, gravity=(0, 1, -9), payloads=(Payload(0.05, offset=(0, 0.01, 0)),))
ZERO = np.zeros(ROD.dof)
TURNS = np.array([5.0, 2.0, 40.0, -10.0, 25.0, 12.0, 0.05])  # torsion, then bending: 3 rad, and 4 and 2.4 turns


def jacobian(function, *arguments, number=0):
    symbols = [ca.MX.sym(function.name_in(i), function.sparsity_in(i)) for i in range(function.n_in())]
    slope = ca.jacobian(ca.vec(ca.densify(function(*symbols))), symbols[number])
    return ca.Function("slope", symbols, [slope])(*arguments).full()


@pytest.mark.parametrize("q", [ZERO, coordinates(ROD), TURNS], ids=["zero", "bent", "turns"])
@pytest.mark.parametrize("name", ["pose", "tip", "mass", "actuation", "cable_lengths", "energy"])
def test_functions_of_the_pose(name, q):
    function = getattr(ROD.model, name)
    fixed = {"pose": (0.45,)}.get(name, ())
    x = np.concatenate([q, np.zeros(ROD.dof)]) if name == "energy" else q
    numeric = derivative(lambda x: function(x, *fixed).full().ravel(order="F"), x, 1e-3)
    scale = max(np.abs(numeric).max(), np.abs(function(x, *fixed).full()).max())
    assert np.allclose(jacobian(function, x, *fixed), numeric, rtol=0, atol=1e-9 * scale)


@pytest.mark.parametrize("q", [ZERO, coordinates(ROD), TURNS], ids=["zero", "bent", "turns"])
def test_accelerations_in_state_and_input(q):
    u = np.array([3.0, -2.0])
    for v in (ZERO, coordinates(ROD, 1)):
        x = np.concatenate([q, v])
        for number, at in enumerate((x, u)):
            numeric = derivative(lambda y: values(ROD.rhs, *((y, u), (x, y))[number]), at, 1e-3)  # noqa: B023
            scale = np.abs(numeric).max()
            assert np.allclose(jacobian(ROD.rhs, x, u, number=number), numeric, rtol=0, atol=1e-8 * scale)


def test_bias_of_a_rich_rod_in_coordinates_and_rates():
    rod = rich_rod()
    q, v = coordinates(rod), coordinates(rod, 1)
    for number in range(2):
        numeric = derivative(lambda y: values(rod.bias, *((y, v), (q, y))[number]), (q, v)[number], 1e-3)  # noqa: B023
        exact = jacobian(rod.bias, q, v, number=number)
        assert np.allclose(exact, numeric, rtol=0, atol=1e-8 * np.abs(numeric).max())


def test_the_pose_changes_along_the_rod_by_the_strain():
    """d pose / ds = pose xi^ up to the order of the kinematics, which a fine mesh makes small."""
    rod = silicone_rod(FREE, quadrature_points=60)
    q = np.array([5.0, 2.0, 10.0, -10.0, 5.0, 12.0, 0.05])
    for s in (0.1, 0.35, 0.59):
        pose, slope = values(rod.pose, q, s), jacobian(rod.pose, q, s, number=1).reshape(4, 4, order="F")
        k, e = values(rod.model.strain, q, s)[:3], values(rod.model.strain, q, s)[3:]
        body = np.array([[0, -k[2], k[1], e[0]], [k[2], 0, -k[0], e[1]], [-k[1], k[0], 0, e[2]], [0, 0, 0, 0]])
        assert np.allclose(np.linalg.solve(pose, slope), body, rtol=0, atol=1e-4)


def test_rotations_stay_rotations_after_many_turns():
    for s in (0.2, 0.6):
        R = values(ROD.pose, TURNS, s)[:3, :3]
        assert np.allclose(R.T @ R, np.eye(3), rtol=0, atol=1e-14)


def test_parameters():
    """Modulus, damping, gravity, payload, load, cable and radius in one rod: rhs in p, and a step in p."""
    p = ca.SX.sym("p", 8)
    rod = Rod(
        0.6,
        Section.circle(p[7]),
        Material(p[0], 0.5, 1000.0, p[1]),
        Strain(bending_y=1, bending_z=1, torsion=0),
        (Cable((p[5], 0.0), friction=p[6]), Cable(Helix(p[5], 0.5))),
        gravity=(0.0, 0.0, p[2]),
        payloads=(Payload(p[3], offset=(0.0, p[5], 0.0)),),
        loads=(PointLoad((0.0, p[4], 0.0)),),
        parameters=(p,),
    )
    at = np.array([1e6, 1e4, -9.81, 0.05, 0.2, 0.02, 0.1, 0.03])
    x, u = np.concatenate([coordinates(rod), coordinates(rod, 1)]), np.array([3.0, 2.0])
    exact = jacobian(rod.rhs, x, u, at, number=2) * at
    numeric = derivative(lambda change: values(rod.rhs, x, u, at * (1 + change)), np.zeros(8), 1e-3)
    assert np.allclose(exact, numeric, rtol=0, atol=1e-8 * np.abs(numeric).max())
    assert (np.abs(numeric).max(axis=0) > 1e-6 * np.abs(numeric).max()).all()
    step = rod.step_expression(0.02, 0.005)
    exact = jacobian(step, x, u, np.zeros(3), at, number=3) * at
    numeric = derivative(lambda change: values(step, x, u, np.zeros(3), at * (1 + change)), np.zeros(8), 1e-3)
    assert np.allclose(exact, numeric, rtol=0, atol=1e-8 * np.abs(numeric).max())


def test_drag_is_smooth_enough_at_rest():
    rod = Rod(0.6, CIRCLE, SILICONE, FREE, drag=Drag((0.1, 0.2), (3.0, 4.0)))
    slope = jacobian(rod.rhs, np.zeros(2 * rod.dof), np.zeros(0))
    still = Rod(0.6, CIRCLE, SILICONE, FREE, drag=Drag((0.1, 0.2)))
    assert np.allclose(slope, jacobian(still.rhs, np.zeros(2 * rod.dof), np.zeros(0)), rtol=0, atol=1e-6)
