"""The box of parameters and its map to the unit cube."""

from collections import namedtuple

import numpy as np
import pytest

from socasadi.tune import Parameter, Space

SPACE = Space(
    [
        Parameter("frequency", "rad/s", 2.0, 10.0, "log"),
        Parameter("damping", "", 0.02, 0.5, "log"),
        Parameter("gain", "m/N", -0.012, 0.012),
    ]
)


def test_corners_of_the_cube_are_the_bounds_exactly():
    np.testing.assert_array_equal(SPACE.from_unit(np.zeros(3)), SPACE.lower)
    np.testing.assert_array_equal(SPACE.from_unit(np.ones(3)), SPACE.upper)
    np.testing.assert_array_equal(SPACE.to_unit(SPACE.lower), np.zeros(3))
    np.testing.assert_array_equal(SPACE.to_unit(SPACE.upper), np.ones(3))


def test_middle_is_the_geometric_mean_on_a_log_scale_and_the_arithmetic_mean_on_a_linear_one():
    middle = SPACE.from_unit(np.full(3, 0.5))
    np.testing.assert_allclose(middle, [np.sqrt(20.0), 0.1, 0.0], rtol=1e-14, atol=1e-17)


def test_every_point_of_the_cube_is_a_valid_theta_that_maps_back():
    rng = np.random.default_rng(0)
    for unit in rng.random((200, 3)):
        np.testing.assert_allclose(SPACE.to_unit(SPACE.check(SPACE.from_unit(unit))), unit, atol=1e-14)


def test_any_object_with_the_five_attributes_is_a_parameter():
    Entry = namedtuple("Entry", "name unit lower upper scale")
    space = Space([Entry("a", "N", -1, 1, "linear"), Entry("b", "s", 1, 100, "log")])
    np.testing.assert_allclose(space.from_unit([0.5, 0.5]), [0.0, 10.0])
    with pytest.raises(ValueError, match=r"'a' has bounds \[1, -1\]"):
        Space([Entry("a", "N", 1, -1, "linear")])


@pytest.mark.parametrize(
    ("lower", "upper", "scale", "said"),
    [
        (1.0, 0.0, "linear", r"'gain' has bounds \[1.0, 0.0\]"),
        (1.0, 1.0, "linear", "lower must be below upper"),
        (0.0, 1.0, "log", "'gain' has a log scale and the lower bound 0.0"),
        (-np.inf, 1.0, "linear", "two finite numbers"),
        (0.0, np.nan, "linear", "two finite numbers"),
        (0.0, 1.0, "cubic", "'cubic'; known are linear, log"),
    ],
)
def test_a_parameter_that_makes_no_sense_is_refused_by_name(lower, upper, scale, said):
    with pytest.raises(ValueError, match=said):
        Parameter("gain", "", lower, upper, scale)


def test_a_name_stands_once_and_a_space_is_not_empty():
    with pytest.raises(ValueError, match="'a' stands 2 times"):
        Space([Parameter("a", "", 0, 1), Parameter("b", "", 0, 1), Parameter("a", "", 0, 1)])
    with pytest.raises(ValueError, match="at least one parameter"):
        Space([])


@pytest.mark.parametrize(
    ("theta", "said"),
    [
        ([3.0, 0.1], r"shape \(2,\); it must be \(3,\)"),
        ([[3.0, 0.1, 0.0]], r"shape \(1, 3\)"),
        ([3.0, np.nan, 0.0], r"theta\[1\] \(damping\) is nan"),
        ([3.0, 0.1, np.inf], r"theta\[2\] \(gain\) is inf"),
        ([3.0, 0.1, 0.2], r"theta\[2\] \(gain\) is 0.2 m/N, outside its bounds \[-0.012, 0.012\]"),
        (["x", 0, 0], "must be 3 numbers"),
    ],
)
def test_a_bad_theta_is_refused_with_the_entry_named(theta, said):
    with pytest.raises(ValueError, match=said):
        SPACE.check(theta)
