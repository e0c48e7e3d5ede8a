"""What a simulated plant promises an experiment: sampling, noise, static starts, named failures."""

import pickle
from dataclasses import replace

import numpy as np
import pytest

from socasadi.plant import Camera, LaserSpot, Plant, PlantFailure, SimulatedPlant
from socasadi.rod import Cable, Chamber, EquilibriumError, Rod

ROD = Rod.preset("paper")


def hold(plant, tension, seconds):
    return [plant.step(tension) for _ in range(round(seconds / plant.sample_time))][-1]


@pytest.fixture(scope="module")
def plant():
    return SimulatedPlant(ROD)


@pytest.fixture(scope="module")
def exact():
    return SimulatedPlant(ROD, noise=0.0)


def test_it_is_a_plant_with_three_inputs_and_two_outputs(plant):
    assert isinstance(plant, Plant)
    assert (plant.inputs, plant.outputs, plant.sample_time) == (3, 2, 0.05)


def test_reset_is_straight_at_rest_with_slack_cables(exact):
    assert np.array_equal(exact.reset(), [0, 0])
    assert np.array_equal(exact.tip, [0.6, 0, 0])
    assert np.array_equal(exact.tension, np.zeros(3))
    for _ in range(20):
        assert np.allclose(exact.step(np.zeros(3)), 0, atol=1e-15)


@pytest.mark.parametrize("bounds", [(-np.inf, np.inf), (0, 10), (1, 10)])
def test_a_reset_pose_stays_where_it_is(exact, bounds):
    y = exact.reset(tip=(-0.01, 0.04), seed=0, tension_bounds=bounds)
    assert np.allclose(y, [-0.01, 0.04], rtol=0, atol=1e-8)
    held = exact.tension
    assert (held >= bounds[0]).all()
    assert (held <= bounds[1]).all()
    for _ in range(20):
        assert np.allclose(exact.step(held), [-0.01, 0.04], rtol=0, atol=1e-8)
    assert exact.time == pytest.approx(1.0)


def test_cables_that_must_pull_rest_at_the_least_tension(exact):
    assert np.allclose(exact.reset(tension_bounds=(0.5, 10)), 0, atol=1e-12)
    assert np.allclose(exact.tension, 0.5)
    assert np.allclose(exact.step(exact.tension), 0, atol=1e-12)


def test_a_hanging_rod_rests_hanging():
    hanging = SimulatedPlant(Rod.preset("hanging"), noise=0.0)
    hanging.reset()
    assert hanging.tip[0] > 0.6
    start = hanging.tip
    hold(hanging, np.zeros(3), 1.0)
    assert np.allclose(hanging.tip, start, rtol=0, atol=1e-10)


def test_a_sagging_rod_rests_sagging():
    sagging = SimulatedPlant(replace(ROD, gravity=(0, 0, -9.81)), noise=0.0)
    y = sagging.reset()
    assert y[1] < -0.1
    assert np.allclose(hold(sagging, np.zeros(3), 1.0), y, rtol=0, atol=1e-7)


def test_a_step_is_the_rod_over_one_sample(exact):
    exact.reset()
    tensions, force = [[5.0, -3.0, 0.0], [0.0, 2.0, 8.0]], [0.0, 0.1, 0.2]
    x = np.zeros(2 * ROD.dof)
    reference = ROD.reference_step(0.05)
    for tension in tensions:
        y = exact.step(tension, force)
        x = reference(x, tension, force).full()[:, 0]
        assert np.allclose(y, ROD.tip(x[: ROD.dof]).full()[1:, 0], rtol=0, atol=1e-5)
        assert np.array_equal(exact.tension, tension)
    assert np.allclose(exact.state, x, rtol=0, atol=2e-2 * np.abs(x).max())
    assert np.allclose(exact.shape(7)[-1], exact.tip, atol=1e-14)
    assert np.allclose(exact.tip[1:], y, atol=0)


def test_noise_is_white_with_the_stated_deviation(plant):
    plant.reset(seed=1)
    y = np.array([plant.step(np.zeros(3)) for _ in range(4000)])
    assert np.allclose(y.mean(axis=0), 0, atol=4 * 1e-3 / np.sqrt(4000))
    assert np.allclose(y.std(axis=0), 1e-3, rtol=0.05)
    lagged = np.array([np.corrcoef(y[:-1, i], y[1:, i])[0, 1] for i in range(2)])
    assert np.allclose([*lagged, np.corrcoef(y.T)[0, 1]], 0, atol=0.06)


def test_the_same_seed_gives_the_same_noise(plant):
    def record(seed):
        return np.array([plant.reset(seed=seed), *(plant.step([5.0, 0.0, 0.0]) for _ in range(5))])

    first = record(7)
    assert np.array_equal(record(7), first)
    assert not np.array_equal(record(8), first)
    assert not np.array_equal(record(None), record(None))


def test_noise_does_not_touch_the_rod(plant, exact):
    for each in (plant, exact):
        each.reset(seed=3)
        each.step([5.0, -3.0, 0.0])
    assert np.array_equal(plant.state, exact.state)


def test_a_tip_too_far_from_the_base_is_a_failure(exact):
    exact.reset()
    with pytest.raises(PlantFailure, match=r"more than 1\.5 times") as caught:
        hold(exact, [-1000.0, -1000.0, -1000.0], 2.0)
    assert caught.value.reason == str(caught.value)
    with pytest.raises(RuntimeError, match="call reset"):
        exact.step(np.zeros(3))
    exact.reset()
    exact.step(np.zeros(3))


def test_a_state_that_is_not_finite_is_a_failure(exact):
    exact.reset()
    with pytest.raises(PlantFailure, match=r"the state is not finite at 0\.05 s"):
        exact.step([1e300, 0.0, 0.0])


@pytest.mark.parametrize(
    ("tension", "message"),
    [
        ([1, 2], r"tension has shape \(2,\), but must have shape \(3,\)"),
        (5.0, r"tension has shape \(\)"),
        ([[1, 2, 3]], r"tension has shape \(1, 3\)"),
        ([1, 2, np.nan], "tension is .* must be finite"),
        (["a", 2, 3], "tension is .* must be 3 numbers in N"),
    ],
)
def test_bad_tension_moves_nothing(exact, tension, message):
    exact.reset()
    state = exact.state
    with pytest.raises(ValueError, match=message):
        exact.step(tension)
    assert np.array_equal(exact.state, state)
    assert exact.time == 0


@pytest.mark.parametrize(
    ("build", "message"),
    [
        (lambda: SimulatedPlant(ROD, sample_time=0), "sample_time is 0"),
        (lambda: SimulatedPlant(ROD, noise=-1), "noise is -1"),
        (lambda: SimulatedPlant(ROD, output=LaserSpot(0.5)), "screen is at distance 0.5 m"),
        (lambda: LaserSpot(np.inf), "distance is inf"),
        (lambda: Camera((1, 0), (0, 0, 0), 500), r"position is \(1, 0\)"),
        (lambda: Camera((1, 0, 0), (0, 0, 0), -5), "focal_length is -5 pixels"),
        (lambda: Camera((1, 0, 0), (1, 0, 0), 500), "must give a line of sight"),
        (lambda: Camera((1, 0, 0), (0, 0, 0), 500, up=(1, 0, 0)), "a direction that is not along it"),
        (lambda: SimulatedPlant(ROD).reset(tip=(0, 0), tension_bounds=(1, -1)), r"tension_bounds is \(1, -1\)"),
        (lambda: SimulatedPlant(ROD).reset(tip=(0, np.nan)), "tip is .* finite"),
    ],
)
def test_bad_settings_are_one_sentence(build, message):
    with pytest.raises(ValueError, match=message):
        build()


def test_before_the_first_reset():
    fresh = SimulatedPlant(ROD)
    for ask in (lambda: fresh.step(np.zeros(3)), lambda: fresh.tip, lambda: fresh.state, fresh.shape):
        with pytest.raises(RuntimeError, match="call reset"):
            ask()


def test_a_tip_out_of_reach_names_the_distance(exact):
    with pytest.raises(EquilibriumError, match="mm away"):
        exact.reset(tip=(0.2, 0.0), tension_bounds=(-10, 10))


def test_the_laser_spot_of_an_arc():
    """A rod bent into an arc points along the chord's double angle: a right-angled triangle to the screen."""
    laser = SimulatedPlant(ROD, noise=0.0, output=LaserSpot(distance=1.0))
    assert np.allclose(laser.reset(), 0, atol=1e-15)
    laser.reset(tip=(0.05, 0.0))
    angle = 2 * np.arctan2(laser.tip[1], laser.tip[0])
    spot = laser.tip[1] + (1.0 - laser.tip[0]) * np.tan(angle)
    assert np.allclose(laser.step(laser.tension), [spot, 0], rtol=0, atol=1e-9)


def test_a_laser_that_misses_its_screen_is_a_failure():
    laser = SimulatedPlant(ROD, noise=0.0, output=LaserSpot(distance=1.0))
    laser.reset()
    with pytest.raises(PlantFailure, match="LaserSpot sees nothing"):
        hold(laser, [80.0, -40.0, -40.0], 2.0)


def test_the_true_output_is_the_measurement_without_noise(plant):
    noisy = SimulatedPlant(ROD, noise=1e-3)
    noisy.reset(tip=(0.02, 0.01), seed=1)
    measured = [noisy.step(noisy.tension) - noisy.true_output for _ in range(200)]
    np.testing.assert_allclose(noisy.true_output, noisy.tip[1:], atol=1e-15)
    assert 0.8e-3 < np.std(measured) < 1.2e-3


def test_a_running_plant_can_be_sent_to_another_process(plant):
    plant.reset(seed=5)
    plant.step([5.0, 0.0, 0.0])
    twin = pickle.loads(pickle.dumps(plant))
    for _ in range(3):
        assert np.array_equal(twin.step([1.0, 2.0, 3.0]), plant.step([1.0, 2.0, 3.0]))


def test_a_camera_sees_the_tip_by_similar_triangles():
    """At 1 m and a focal length of 500 a displacement of 1 mm is half a pixel; left and up are negative."""
    camera = SimulatedPlant(ROD, noise=0.0, output=Camera((1.6, 0, 0), (0.6, 0, 0), focal_length=500))
    assert np.allclose(camera.reset(), 0, atol=1e-12)
    pixels = camera.reset(tip=(0.02, 0.03))
    depth = 1.6 - camera.tip[0]
    # Looking against +x with +z upright, +y is to the right.
    assert np.allclose(pixels, 500 * np.array([0.02, -0.03]) / depth, rtol=1e-7)


def test_a_tip_behind_the_camera_is_not_seen():
    behind = SimulatedPlant(ROD, noise=0.0, output=Camera((0.5, 0, 0), (0.0, 0, 0), focal_length=500))
    with pytest.raises(PlantFailure, match="Camera sees nothing"):
        behind.reset()


def test_what_a_plant_shows_does_not_depend_on_where_its_base_stands():
    """Turn base, gravity and disturbance together: the same experiment, seen from the base."""
    turn = np.array([[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]])
    gravity = np.array([9.81, 0.0, 0.0])
    here = SimulatedPlant(replace(ROD, gravity=gravity), noise=0.0)
    there = replace(ROD, gravity=turn @ gravity, base_rotation=turn, base_position=(1.0, 2.0, 3.0))
    there = SimulatedPlant(there, noise=0.0)
    assert np.allclose(there.reset(tip=(0.01, 0.02)), here.reset(tip=(0.01, 0.02)), atol=1e-12)
    for _ in range(5):
        assert np.allclose(there.step([5, -3, 0], [0, 0.1, 0.2]), here.step([5, -3, 0], [0, 0.1, 0.2]), atol=1e-10)
    assert np.allclose(there.tip, here.tip, atol=1e-10)
    assert np.allclose(there.shape(5), here.shape(5), atol=1e-10)


def test_chambers_and_cables_of_given_length_drive_a_plant():
    chambers = tuple(Chamber(cable.route, area=1e-4) for cable in ROD.cables)
    pushed = SimulatedPlant(replace(ROD, cables=chambers), noise=0.0)
    pulled = SimulatedPlant(ROD, noise=0.0)
    pushed.reset()
    pulled.reset()
    assert np.allclose(pushed.step([5e4, 0, 0]), pulled.step([-5, 0, 0]), atol=1e-12)
    wires = tuple(Cable(cable.route, drive="length", stiffness=5e4) for cable in ROD.cables)
    servo = SimulatedPlant(replace(ROD, cables=wires), noise=0.0)
    assert np.allclose(servo.reset(), 0)
    assert np.allclose(servo.tension, 0.6)
    assert hold(servo, [0.59, 0.6, 0.6], 1.0)[0] > 0.05
