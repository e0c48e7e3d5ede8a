"""A model that is given, and one that a record gives."""

import numpy as np
import pytest

from socasadi import Fixed, LinearMPC, Modal
from socasadi.campaign.store import describe, rebuild
from socasadi.model import Record, StateSpace, identify, prediction_error, state_space_error, subspace

THETA = np.array([4.4, 0.1, 0.0056, -0.0028, -0.0028, 4.7, 0.08, 0.0, 0.0049, -0.0049])
SYSTEM = Modal().state_space(THETA, 0.05)


def record(samples, noise=0.0, hold=10, seed=0):
    rng = np.random.default_rng(seed)
    u = np.repeat(rng.uniform(-5, 5, (samples // hold, 3)), hold, axis=0)
    x, y = np.zeros(4), [np.zeros(2)]
    for row in u:
        x = SYSTEM.A @ x + SYSTEM.B @ row
        y.append(SYSTEM.C @ x)
    return Record(0.05, u, np.array(y) + noise * rng.standard_normal((samples + 1, 2)))


def test_a_fixed_model_is_its_system_and_has_nothing_open():
    model = Fixed.of(SYSTEM, 0.05)
    assert (model.size, model.order, model.inputs, model.axes) == (0, 4, 3, 2)
    for name, found, given in zip("ABCD", model.state_space((), 0.05), SYSTEM, strict=True):
        np.testing.assert_array_equal(found, given, err_msg=name)
    assert prediction_error(model, (), record(200)) < 1e-12
    assert identify(model, record(200)).shape == (0,)
    assert rebuild(describe(model)) == model


def test_its_controller_is_that_of_the_model():
    fixed, modal = LinearMPC(Fixed.of(SYSTEM, 0.05), tuned=("R",)), LinearMPC(Modal())
    ours, theirs = fixed.controller([1.0]), modal.controller(THETA)
    for y in 0.01 * np.random.default_rng(0).standard_normal((20, 2)):
        np.testing.assert_array_equal(ours.step(y, [0.02, 0.0]), theirs.step(y, [0.02, 0.0]))


def test_what_does_not_fit_is_refused():
    with pytest.raises(ValueError, match=r"B of a fixed model has shape \(4, 2\); \(4, 3\) fits"):
        Fixed(2, 3, None, SYSTEM.A, SYSTEM.B[:, :2], SYSTEM.C, SYSTEM.D)
    with pytest.raises(ValueError, match="C of a fixed model is not finite"):
        Fixed.of(StateSpace(SYSTEM.A, SYSTEM.B, np.nan * SYSTEM.C, SYSTEM.D), 0.05)
    with pytest.raises(ValueError, match=r"every 0.05 s, not every 0.1 s"):
        Fixed.of(SYSTEM, 0.05).state_space((), 0.1)


def test_a_record_gives_the_model_back_with_its_order():
    found = subspace(record(600, noise=1e-4))
    assert len(found.A) >= 4
    for k in (0, 5, 20):
        theirs, true = (m.C @ np.linalg.matrix_power(m.A, k) @ m.B for m in (found, SYSTEM))
        np.testing.assert_allclose(theirs, true, atol=2e-5)


def test_the_gain_at_rest_of_a_noisy_record_is_right_to_a_hundredth():
    found = subspace(record(800, noise=1e-3, hold=20))
    theirs, true = (m.C @ np.linalg.solve(np.eye(len(m.A)) - m.A, m.B) for m in (found, SYSTEM))
    np.testing.assert_allclose(theirs, true, atol=0.01 * np.abs(true).max())


def softer(samples, by, seed):
    """A record of a robot with other gains."""
    given = record(samples, noise=1e-4, seed=seed)
    return Record(given.sample_time, given.tension, by * given.output)


def test_fitted_to_flights_a_model_is_the_least_off_of_all_with_its_poles():
    """Over all records together; the first record alone is then predicted a little worse."""

    def off(model, *records):
        return np.sqrt(sum(len(r.tension) * state_space_error(model, r) ** 2 for r in records))

    probed, flights = record(600, noise=1e-4), [softer(200, 1.1, seed=1), softer(300, 1.2, seed=2)]
    alone, both = subspace(probed), subspace(probed, flights=flights)
    for name in "ACD":
        np.testing.assert_array_equal(getattr(alone, name), getattr(both, name), err_msg=name)
    assert off(both, probed, *flights) < off(alone, probed, *flights)
    assert off(alone, probed) < off(both, probed)
    other = subspace(probed, flights=flights[1:])
    for away in (both.B - alone.B, both.B - other.B):
        for step in (-0.02, 0.02):
            moved = both._replace(B=both.B + step * away)
            assert off(moved, probed, *flights) > off(both, probed, *flights)


def test_flights_may_come_one_by_one():
    flights = [softer(200, 1.1, seed=1), softer(300, 1.2, seed=2)]
    at_once, in_turn = subspace(record(600), flights=flights), subspace(record(600), flights=iter(flights))
    np.testing.assert_array_equal(at_once.B, in_turn.B)


def test_where_a_flight_starts_is_no_matter():
    """The robot's linear response is that of a record whose start is cut off."""
    whole = record(600, noise=1e-6, seed=1)
    cut = Record(whole.sample_time, whole.tension[37:], whole.output[37:])
    model = subspace(record(600, noise=1e-6), flights=[cut])
    assert state_space_error(model, whole) < 1e-5


def test_a_flight_of_another_robot_is_refused():
    other = record(200)
    for wrong, told in (
        (Record(0.1, other.tension, other.output), "sample_time of flight 1 is 0.1, but 0.05 of the record"),
        (Record(0.05, other.tension[:, :2], other.output), "inputs of flight 1 is 2, but 3 of the record"),
        (Record(0.05, other.tension, other.output[:, :1]), "outputs of flight 1 is 1, but 2 of the record"),
    ):
        with pytest.raises(ValueError, match=told):
            subspace(record(600), flights=[other, wrong])
    with pytest.raises(ValueError, match="inputs of flight 0 is 2"):
        subspace(record(600), flights=[Record(0.05, other.tension[:, :2], other.output)])


def test_a_record_that_is_too_short_is_told_so():
    with pytest.raises(ValueError, match="100 samples; 129 are needed"):
        subspace(record(100))
