"""A rod does not know how its laboratory is turned: base, gravity and dead loads moved together change nothing."""

from dataclasses import replace

import numpy as np
import pytest
from rod_support import coordinates, rich_rod, values
from scipy.spatial.transform import Rotation

from socasadi.rod import Rod, pointing

TURN = Rotation.from_rotvec([0.7, -1.9, 0.4]).as_matrix()
SHIFT = np.array([3.0, -2.0, 1.0])


def moved(rod):
    """The rod with its base, gravity and dead loads turned, and its base shifted."""
    loads = tuple(
        load if load.follower else replace(load, force=turned(load.force), moment=turned(load.moment))
        for load in rod.loads
    )
    return replace(
        rod,
        base_rotation=TURN @ np.array(rod.base_rotation),
        base_position=TURN @ rod.base_position + SHIFT,
        gravity=TURN @ rod.gravity,
        loads=loads,
    )


def turned(value):
    return (lambda s: TURN @ value(s)) if callable(value) else TURN @ value


@pytest.fixture(scope="module")
def pair():
    rod = rich_rod()
    return rod, moved(rod)


def test_coordinates_move_alike(pair):
    here, there = pair
    q, v, u = coordinates(here), coordinates(here, 1, 2.0), np.array([2.0, 1.0, -1.0, 1e3])
    x, force = np.concatenate([q, v]), np.array([0.1, -0.2, 0.3])
    assert np.allclose(values(there.mass, q), values(here.mass, q), rtol=0, atol=1e-15)
    bias = values(here.bias, q, v)
    assert np.allclose(values(there.bias, q, v), bias, rtol=0, atol=1e-13 * np.abs(bias).max())
    assert np.allclose(values(there.actuation, q), values(here.actuation, q), rtol=0, atol=1e-15)
    expected = values(here.forced_rhs, x, u, force)
    assert np.allclose(
        values(there.forced_rhs, x, u, TURN @ force), expected, rtol=0, atol=1e-9 * np.abs(expected).max()
    )


def test_poses_turn_and_shift_and_energy_shifts_by_the_weight(pair):
    here, there = pair
    q = coordinates(here)
    for s in (0.0, 0.17, 0.6):
        expected, pose = values(here.pose, q, s), values(there.pose, q, s)
        assert np.allclose(pose[:3, :3], TURN @ expected[:3, :3], rtol=0, atol=1e-14)
        assert np.allclose(pose[:3, 3], TURN @ expected[:3, 3] + SHIFT, rtol=0, atol=1e-14)
    seen = there.in_base_frame(values(there.tip, q))
    assert np.allclose(seen, here.in_base_frame(values(here.tip, q)), rtol=0, atol=1e-14)
    both = [np.concatenate([coordinates(here, seed), coordinates(here, seed + 1)]) for seed in (0, 5)]
    change = [float(rod.energy(both[0])) - float(rod.energy(both[1])) for rod in pair]
    assert change[0] == pytest.approx(change[1], rel=1e-12)


def test_equilibria_and_steps_are_the_same(pair):
    here, there = pair
    tension, force, follower = [2.0, 1.0, 0.5, 1e3], np.array([0.05, -0.1, 0.1]), (0.0, 0.05, 0.0)
    one = here.equilibrium(tension, force, follower_force=follower)
    other = there.equilibrium(tension, TURN @ force, follower_force=follower)
    assert np.allclose(other.q, one.q, rtol=0, atol=1e-11)
    assert np.allclose(other.tip, TURN @ one.tip + SHIFT, rtol=0, atol=1e-11)
    assert np.allclose(other.rotation, TURN @ one.rotation, rtol=0, atol=1e-11)
    both = np.kron(np.eye(2), TURN)
    assert np.allclose(other.compliance, both @ one.compliance @ both.T, rtol=0, atol=1e-9)
    steps = [values(rod.step_expression(0.05, 0.01), one.state, np.zeros(4), np.zeros(3)) for rod in pair]
    assert np.allclose(steps[0], steps[1], rtol=0, atol=1e-11)


def test_mirrored_inputs_give_mirrored_poses():
    """A rod alike on both sides of a plane: reflection in z swaps the cables and turns the pose over."""
    rod = replace(Rod.preset("paper"), gravity=(0.0, -9.81, 0.0))
    one, other = rod.equilibrium([3.0, 5.0, -2.0]), rod.equilibrium([3.0, -2.0, 5.0])
    assert np.allclose(one.tip, other.tip * [1, 1, -1], rtol=0, atol=1e-13)


@pytest.mark.parametrize(
    "direction", [(0, 0, 1), (0, 0, -2), (1, 0, 0), (-1, 0, 0), (0, -3, 0), (-1, 1e-9, 0), (-0.9, 0.3, 0.2)]
)
def test_a_rod_can_be_pointed_anywhere(direction):
    rotation = np.array(pointing(direction))
    assert np.allclose(rotation.T @ rotation, np.eye(3), rtol=0, atol=1e-14)
    assert np.linalg.det(rotation) == pytest.approx(1)
    assert np.allclose(rotation[:, 0], direction / np.linalg.norm(direction), rtol=0, atol=1e-8)
    turn = np.arccos(np.clip((np.trace(rotation) - 1) / 2, -1, 1))
    angle = np.arccos(direction[0] / np.linalg.norm(direction))
    assert turn == pytest.approx(angle, abs=1e-6)  # the shortest way
    rod = replace(Rod.preset("paper"), base_rotation=rotation)
    assert np.allclose(values(rod.tip, np.zeros(8)), 0.6 * rotation[:, 0], rtol=0, atol=1e-12)
