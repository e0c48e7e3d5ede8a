"""Payloads, point and distributed loads, drag."""

from dataclasses import replace

import numpy as np
import pytest
from rod_support import CIRCLE, SILICONE, UPWARDS, coordinates, silicone_rod, values

from socasadi.rod import DistributedLoad, Drag, Payload, PointLoad, Rod, Strain

FREE = Strain(bending_y=3, bending_z=3, torsion=1, stretch=0)
EI, AREA = 1e6 * CIRCLE.Iz, CIRCLE.area
DOWN = (0.0, 0.0, -9.81)


def rod(strain=FREE, **changes) -> Rod:
    return silicone_rod(strain, **changes)


def cantilever(**changes) -> Rod:
    """For closed forms of small deflections: bending alone, fine quadrature."""
    return silicone_rod(Strain(bending_y=4, bending_z=4), quadrature_points=12, **changes)


def test_a_payload_hangs_as_its_weight_does():
    hung = rod(gravity=DOWN, payloads=(Payload(0.05),)).equilibrium().tip
    for weighed in (
        rod(gravity=DOWN).equilibrium(tip_force=(0, 0, -0.05 * 9.81)),
        rod(gravity=DOWN, loads=(PointLoad((0, 0, -0.05 * 9.81)),)).equilibrium(),
    ):
        assert np.allclose(weighed.tip, hung, rtol=0, atol=1e-13)


@pytest.mark.parametrize("s", [0.1, 0.3, 0.457])
def test_a_payload_and_a_load_part_way(s):
    hung = rod(gravity=DOWN, payloads=(Payload(0.2, s=s),)).equilibrium().tip
    weighed = rod(gravity=DOWN, loads=(PointLoad((0, 0, -0.2 * 9.81), s=s),)).equilibrium().tip
    assert np.allclose(hung, weighed, rtol=0, atol=1e-13)
    P = 1e-5
    deflection = P * (s**3 / 3 + s**2 / 2 * (0.6 - s)) / EI
    # Polynomials of degree 4 come near a moment with a kink, and the tip's error is theirs squared.
    point = cantilever(loads=(PointLoad((0, P, 0), s=s),)).equilibrium().tip[1]
    assert point == pytest.approx(deflection, rel=5e-3)


def test_an_offset_payload_turns_the_rod():
    """m g d about the axis; with the offset along the axis it hangs lower as a longer lever would."""
    mass, offset = 0.01, 0.02
    twisted = silicone_rod(Strain(torsion=0), gravity=DOWN, payloads=(Payload(mass, offset=(0, offset, 0)),))
    GJ = 1e6 / 3 * CIRCLE.J
    twist = twisted.equilibrium().q[0]
    assert twist * GJ == pytest.approx(-mass * 9.81 * offset * np.cos(0.6 * twist), rel=1e-12)
    beyond = rod(gravity=DOWN, payloads=(Payload(mass, offset=(offset, 0, 0)),)).equilibrium()
    force = np.array([0, 0, -mass * 9.81])
    moment = np.cross(beyond.rotation @ [offset, 0, 0], force)
    assert np.allclose(rod(gravity=DOWN).equilibrium(tip_force=force, tip_moment=moment).tip, beyond.tip, atol=1e-12)


def test_a_payload_adds_its_kinetic_energy():
    body = Payload(
        0.05, s=0.3, inertia=[[3e-5, 1e-6, 0], [1e-6, 2e-5, 2e-6], [0, 2e-6, 1e-5]], offset=(0.01, -0.02, 0.03)
    )
    with_body, without = rod(payloads=(body,), quadrature_points=21), rod(quadrature_points=21)
    q, v = coordinates(without), coordinates(without, 1)
    twist = values(without.model.twist, q, v, 0.3)
    moving = twist[3:] + np.cross(twist[:3], body.offset)
    energy = (0.05 * moving @ moving + twist[:3] @ np.array(body.inertia) @ twist[:3]) / 2
    added = values(with_body.mass, q) - values(without.mass, q)
    # With an odd number of Gauss points one is at mid-length: both rods stop at the same places.
    assert v @ added @ v / 2 == pytest.approx(energy, rel=1e-9)
    assert np.allclose(
        values(rod(payloads=(Payload(0.05, inertia=(1, 2, 3)),)).mass, 0 * q),
        values(rod(payloads=(Payload(0.05, inertia=np.diag([1, 2, 3])),)).mass, 0 * q),
    )


def test_a_payload_on_the_tip_of_a_light_rod_falls_freely_sideways():
    """A stretchy rod without stiffness to speak of: its payload accelerates with gravity."""
    slack = Rod(
        0.6,
        CIRCLE,
        replace(SILICONE, young=1e-6, density=1e-6, damping=0.0),
        Strain(shear_y=0, shear_z=0, stretch=0),
        gravity=(1.0, 2.0, 3.0),
        payloads=(Payload(0.5),),
    )
    assert np.allclose(0.6 * values(slack.rhs, np.zeros(6), [])[3:], [1, 2, 3], rtol=1e-6)


def test_several_payloads_and_loads_add_up():
    parts = (Payload(0.02), Payload(0.03), Payload(0.05, s=0.3))
    one = (Payload(0.05), Payload(0.05, s=0.3))
    q = coordinates(rod())
    assert np.allclose(values(rod(payloads=parts).mass, q), values(rod(payloads=one).mass, q), rtol=0, atol=1e-15)
    loads = (PointLoad((0, 0.1, 0), s=0.3), PointLoad((0, 0.2, 0.1), s=0.3))
    sum_of = rod(loads=(PointLoad((0, 0.3, 0.1), s=0.3),)).equilibrium().tip
    assert np.allclose(rod(loads=loads).equilibrium().tip, sum_of, rtol=0, atol=1e-13)


def test_dead_loads_keep_their_direction_and_followers_turn():
    """In the bent pose either is the other, turned by the section's rotation there."""
    s, force, moment = 0.4, np.array([0.05, 0.2, -0.3]), np.array([0.01, 0.02, -0.01])
    bent = rod(loads=(PointLoad(force, moment, s=s, follower=True),), base_rotation=UPWARDS).equilibrium()
    R = values(bent.rod.pose, bent.q, s)[:3, :3]
    dead = rod(loads=(PointLoad(R @ force, R @ moment, s=s),), base_rotation=UPWARDS).equilibrium()
    assert np.allclose(dead.tip, bent.tip, rtol=0, atol=1e-12)
    unturned = rod(loads=(PointLoad(force, moment, s=s),), base_rotation=UPWARDS).equilibrium()
    assert np.linalg.norm(unturned.tip - bent.tip) > 1e-3
    # At the tip: as an argument of equilibrium, or as the rod's own.
    own = rod(loads=(PointLoad(force, moment, follower=True),)).equilibrium()
    given = rod().equilibrium(follower_force=force, follower_moment=moment)
    assert np.allclose(own.tip, given.tip, rtol=0, atol=1e-13)


def test_a_dead_moment_turns_about_the_worlds_axis():
    """About the world's x at the tip of a rod bent by a quarter turn towards y, it bends the rod out of plane."""
    quarter = silicone_rod(FREE, loads=(PointLoad(moment=(0, 0, EI * np.pi / 2 / 0.6)),))
    pushed = quarter.equilibrium(tip_moment=(1e-4, 0, 0))
    follower = quarter.equilibrium(follower_moment=tuple(quarter.equilibrium().rotation.T @ [1e-4, 0, 0]))
    assert np.allclose(pushed.tip, follower.tip, rtol=0, atol=1e-7)
    assert abs(pushed.tip[2]) > 1e-5


def test_a_dead_uniform_load_is_gravity():
    weight = DistributedLoad((0.0, 0.0, -9.81 * 1000 * AREA))
    loaded, heavy = rod(loads=(weight,)), rod(gravity=DOWN)
    assert np.allclose(loaded.equilibrium().tip, heavy.equilibrium().tip, rtol=0, atol=1e-13)
    x = np.concatenate([coordinates(loaded), coordinates(loaded, 1)])
    expected = values(heavy.rhs, x, [])
    assert np.allclose(values(loaded.rhs, x, []), expected, rtol=0, atol=1e-12 * np.abs(expected).max())


@pytest.mark.parametrize("follower", [False, True])
def test_distributed_loads_bend_a_cantilever_as_in_the_textbook(follower):
    w, L = 1e-5, 0.6

    def tip(**load):
        return cantilever(loads=(DistributedLoad(**load, follower=follower),)).equilibrium().tip

    assert tip(force=(0, w, 0))[1] == pytest.approx(w * L**4 / (8 * EI), rel=1e-6)
    assert tip(force=lambda s: (0, 0, w * s))[2] == pytest.approx(11 * w * L**5 / (120 * EI), rel=1e-6)
    assert tip(moment=(0, 0, w))[1] == pytest.approx(w * L**3 / (3 * EI), rel=1e-6)
    a = 0.25  # over the first part alone, then over the rest
    part = w * a**4 / (8 * EI) + w * a**3 / (6 * EI) * (L - a)
    assert tip(force=(0, w, 0), end=a)[1] == pytest.approx(part, rel=2e-3)
    assert tip(force=(0, w, 0), start=a)[1] == pytest.approx(w * L**4 / (8 * EI) - part, rel=2e-3)


def test_a_follower_load_turns_and_a_dead_one_does_not():
    """A uniform pressure that stays normal bends an inextensible rod into a curve whose tip shear is zero."""
    for follower in (False, True):
        bent = rod(loads=(DistributedLoad((0, 3.0, 0), follower=follower),)).equilibrium()
        q = bent.q
        nodes, weights = np.polynomial.legendre.leggauss(40)
        base = np.zeros(3)
        for s, weight in zip(0.3 * (nodes + 1), 0.3 * weights, strict=True):
            pose = values(bent.rod.pose, q, s)
            base += weight * np.cross(pose[:3, 3], (pose[:3, :3] if follower else np.eye(3)) @ [0, 3.0, 0])
        # The moment that the base bears is EI kappa there, within what polynomials of degree 3 can do.
        assert values(bent.rod.model.strain, q, 0.0)[2] * EI == pytest.approx(base[2], rel=0.01)


def test_a_load_over_part_of_a_rod_of_two_divisions():
    division = replace(rod().divisions[0], length=0.3)
    two = Rod(divisions=(division, division), loads=(DistributedLoad((0, 0.5, 0), start=0.2, end=0.45),))
    fine = rod(strain=Strain(bending_y=7, bending_z=7, torsion=1, stretch=0), loads=two.loads, quadrature_points=12)
    assert np.allclose(two.equilibrium().tip, fine.equilibrium().tip, rtol=0, atol=2e-6)


def test_linear_and_quadratic_drag_resist_along_their_axes():
    """Rods that only slide: the force per metre is the coefficient of that direction."""
    L, speed = 0.6, 0.7
    for name, index in (("stretch", 0), ("shear_y", 1), ("shear_z", 1)):
        for kind, power in (("linear", 1), ("quadratic", 2)):
            for sign in (1, -1):
                coefficients = [0.0, 0.0]
                coefficients[index] = 3.0
                wet = silicone_rod(Strain(**{name: 0}), drag=Drag(**{kind: coefficients}))
                dry = replace(wet, drag=None)
                force = values(wet.bias, [0.0], [sign * speed]) - values(dry.bias, [0.0], [sign * speed])
                # The velocity is s times the rate: the generalised force is the integral of 3 |v|^(power - 1) v s.
                expected = sign * 3.0 * speed**power * L ** (power + 2) / (power + 2)
                assert force == pytest.approx([expected], rel=1e-4)
                other = replace(wet, drag=Drag(**{kind: coefficients[::-1]}))
                assert values(other.bias, [0.0], [speed]) == pytest.approx(values(dry.bias, [0.0], [speed]), rel=1e-9)


def test_angular_drag():
    for name, index in (("torsion", 0), ("bending_y", 1), ("bending_z", 1)):
        coefficients = [0.0, 0.0]
        coefficients[index] = 2.0
        wet = silicone_rod(Strain(**{name: 0}), drag=Drag(angular=coefficients))
        force = values(wet.bias, [0.0], [0.5]) - values(replace(wet, drag=None).bias, [0.0], [0.5])
        assert force == pytest.approx([2.0 * 0.5 * 0.6**3 / 3], rel=1e-6)


def test_normal_drag_goes_by_the_whole_normal_velocity():
    """Quadratic drag across the rod: |v_n| v_n, not each component by itself."""
    wet = silicone_rod(Strain(shear_y=0, shear_z=0), drag=Drag(quadratic=(0.0, 5.0)))
    v = np.array([0.3, 0.4])
    force = values(wet.bias, np.zeros(2), v) - values(replace(wet, drag=None).bias, np.zeros(2), v)
    assert np.allclose(force, 5.0 * 0.5 * v * 0.6**4 / 4, rtol=1e-4)


def test_a_rod_that_a_force_drags_reaches_its_terminal_speed():
    """Soft and wide open to shear: the driving force and the quadratic drag balance, the stiffness being nothing."""
    limp = replace(SILICONE, young=1e-9, damping=0.0)
    wet = Rod(0.6, CIRCLE, limp, Strain(shear_y=0), loads=(PointLoad((0, 0.3, 0)),), drag=Drag(quadratic=(0.0, 50.0)))
    x = np.zeros(2)
    step = wet.step_expression(0.5, 0.01)
    for _ in range(8):
        x = values(step, x, [], np.zeros(3))
    # P L = integral of 50 (v s)^2 s ds = 50 v^2 L^4 / 4
    assert x[1] == pytest.approx(np.sqrt(4 * 0.3 / (50 * 0.6**3)), rel=1e-3)


def test_a_load_at_a_boundary_counts_once():
    """0.1 + 0.2 is not 0.3 in floating point; where two divisions meet a load or a payload still acts once."""
    half = silicone_rod(Strain(bending_z=1), length=0.3).divisions[0]
    assert 0.1 + 0.2 > 0.3
    for s in (0.3, 0.1 + 0.2, 0.3 + 1e-13, 0.3 - 1e-13):
        pushed = Rod(divisions=(half, half), loads=(PointLoad((0, 1e-4, 0), s=s),)).equilibrium().tip[1]
        assert pushed == pytest.approx(1e-4 * (0.3**3 / 3 + 0.3**2 / 2 * 0.3) / EI, rel=1e-5)
        mass = values(Rod(divisions=(half, half), payloads=(Payload(0.1, s=s),)).mass, np.zeros(4))
        added = mass - values(Rod(divisions=(half, half)).mass, np.zeros(4))
        assert added[0, 0] == pytest.approx(0.1 * 0.3**4 / 4, rel=1e-9)
        assert np.allclose(added[2:, 2:], 0, atol=1e-12)


def test_a_load_a_rounding_beyond_the_tip_is_at_the_tip():
    for s in (0.6, 0.6 + 1e-13, 0.6 + 1e-11):
        assert rod(loads=(PointLoad((0, 0.1, 0), s=s),)).equilibrium().tip[1] > 0.01
