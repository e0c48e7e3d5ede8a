"""theta may hold factors on an MPC's settings beside its prediction model."""

from dataclasses import replace

import numpy as np
import pytest

from socasadi import LinearMPC, Modal
from socasadi.campaign.store import describe, rebuild
from socasadi.model import Entry

MODEL = Modal.from_spec(length=0.6, bending_stiffness=0.64, mass_per_length=2.8, cable_offset=0.02)
THETA = np.array([4.4, 0.1, 0.0056, -0.0028, -0.0028, 4.7, 0.08, 0.0, 0.0049, -0.0049])


def inputs(controller, samples=40):
    rng = np.random.default_rng(0)
    return np.array([controller.step(y, [0.03, -0.01]) for y in 0.01 * rng.standard_normal((samples, 2))])


def test_the_factors_stand_behind_the_model_with_names_and_ranges():
    mpc = LinearMPC(MODEL, tuned={"R": (0.1, 10.0), "input_noise": (1e-3, 1.0)})
    assert mpc.entries[: MODEL.size] == MODEL.entries
    assert mpc.entries[MODEL.size] == Entry("R_factor", "1", 0.1, 10.0, "log")
    assert [entry.name for entry in LinearMPC(MODEL, tuned=("slack_weight",)).entries[MODEL.size :]] == [
        "slack_weight_factor"
    ]
    assert LinearMPC(MODEL).entries == MODEL.entries


def test_the_controller_of_theta_is_that_of_the_settings_that_it_means():
    mpc = LinearMPC(MODEL, tuned=("R", "input_noise", "measurement_noise"))
    theta = np.concatenate([THETA, [3.0, 0.1, 2.0]])
    meant = replace(mpc, R=3.0, input_noise=0.05, measurement_noise=2e-3, tuned=())
    assert mpc.at(theta) == meant
    np.testing.assert_array_equal(inputs(mpc.controller(theta)), inputs(meant.controller(THETA)))
    assert not np.allclose(inputs(mpc.controller(theta)), inputs(mpc.controller(mpc.whole(THETA))))


def test_a_factor_on_noise_is_one_on_its_deviation_whether_that_is_given_or_a_covariance():
    deviation = LinearMPC(MODEL, input_noise=(0.5, 0.4, 0.3), tuned=("input_noise",))
    covariance = LinearMPC(MODEL, input_noise=np.diag([0.25, 0.16, 0.09]), tuned=("input_noise",))
    theta = np.concatenate([THETA, [3.0]])
    np.testing.assert_allclose(deviation.at(theta).noise.input, covariance.at(theta).noise.input)
    np.testing.assert_allclose(deviation.at(theta).noise.input, np.diag([0.25, 0.16, 0.09]) * 9)


def test_settings_as_they_are_have_the_factor_1_or_the_nearest_in_its_range():
    mpc = LinearMPC(MODEL, tuned={"R": (0.1, 10.0), "input_noise": (1e-3, 0.1)})
    np.testing.assert_array_equal(mpc.whole(THETA), [*THETA, 1.0, 0.1])


def test_it_is_described_and_made_again():
    mpc = LinearMPC(MODEL, tuned={"R": (0.1, 10.0)})
    assert rebuild(describe(mpc)) == mpc
    assert replace(mpc, R=2.0).tuned == mpc.tuned


@pytest.mark.parametrize(
    ("tuned", "fault"),
    [
        ("R", "not the text 'R'"),
        (("horizon",), "'horizon'; what can be tuned is Q, R"),
        (("R", "R"), "'R' twice"),
        ({"R": (10.0, 0.1)}, "10 to 0.1"),
        ({"R": (0.0, 1.0)}, "0 to 1"),
    ],
)
def test_what_cannot_be_tuned_is_refused(tuned, fault):
    with pytest.raises(ValueError, match=fault):
        LinearMPC(MODEL, tuned=tuned)


def test_a_theta_that_lacks_its_factors_or_has_senseless_ones_is_refused():
    mpc = LinearMPC(MODEL, tuned=("R",))
    with pytest.raises(ValueError, match=r"\(11,\): 10 of its Modal and 1 factors"):
        mpc.controller(THETA)
    with pytest.raises(ValueError, match="R_factor is a factor, not -1"):
        mpc.controller([*THETA, -1.0])
    with pytest.raises(ValueError, match=r"take that of mpc\.at"):
        _ = mpc.formulation
