"""Output transforms: increasing, invertible, and blind to what they claim not to see."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from socasadi.tune.surrogate import transform_named

NAMES = ("power", "power-half-rank", "half-rank", "log", "log-half-rank", "box-cox", "yeo-johnson", "none")
POSITIVE = ("log-half-rank", "log", "box-cox")
HALF_RANKS = {"log-half-rank": np.log, "half-rank": np.array}

random = np.random.default_rng(0)
LIGHT = np.exp(random.normal(size=60))
# Thirty good costs within a decade or two, and thirty that differ by as many decades again.
HEAVY = np.exp(np.concatenate([random.normal(size=30), random.uniform(10, 40, size=30)]))
TELLING = st.lists(st.floats(1e-3, 1e3), min_size=1, max_size=25)


def standardised(values):
    return (values - values.mean()) / values.std()


def scales(name, costs):
    """Each of the scales that the transform may choose for those costs."""
    costs = np.asarray(costs)
    return [fit(costs) for fit in transform_named(name).ways(costs)]


def only(name, costs):
    (scale,) = scales(name, costs)
    return scale


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("costs", [LIGHT, HEAVY, np.array([3.0]), np.array([2.0, 2.0, 5.0]), np.full(5, 7.0)])
def test_the_order_of_costs_is_kept(name, costs):
    order = np.argsort(costs, kind="stable")
    apart = np.diff(costs[order]) > 0
    better = costs[order][1:] <= np.median(costs)
    for scale in scales(name, costs):
        targets = scale.forward(costs)
        assert targets.shape == costs.shape
        assert np.isfinite(targets).all()
        steps = np.diff(targets[order])
        assert (steps[apart] >= 0).all()
        assert (steps[~apart] == 0).all()
        if costs is not HEAVY:  # where a power near the linear one leaves no digits for the good
            assert (steps[apart & better] > 0).all()


def increases_and_comes_back(scale, costs):
    targets = scale.forward(costs)
    assert np.isfinite(targets).all()
    size = 1 + np.abs(targets).max()
    assert (np.diff(targets) >= -1e-12 * size).all()
    # A power may press large costs together: what is restored is the target.
    np.testing.assert_allclose(scale.forward(scale.inverse(targets)), targets, rtol=1e-7, atol=1e-9 * size)


@pytest.mark.parametrize("name", NAMES)
@given(costs=TELLING, other=st.lists(st.floats(1e-4, 1e4), min_size=2, max_size=10))
@settings(max_examples=40, deadline=None, derandomize=True)
def test_it_increases_everywhere_and_its_inverse_is_one(name, costs, other):
    for scale in scales(name, costs):
        increases_and_comes_back(scale, np.sort(np.concatenate([other, costs])))
        good = np.sort(costs)[: (len(costs) + 1) // 2]
        np.testing.assert_allclose(scale.inverse(scale.forward(good)), good, rtol=1e-6)


@pytest.mark.parametrize("name", [name for name in NAMES if name not in POSITIVE])
@given(costs=st.lists(st.integers(-(10**9), 10**9).map(lambda n: n * 1e-6), min_size=1, max_size=25))
@settings(max_examples=40, deadline=None, derandomize=True)
def test_costs_of_either_sign_keep_their_order_and_come_back(name, costs):
    for scale in scales(name, costs):
        increases_and_comes_back(scale, np.sort(costs))


@pytest.mark.parametrize("name", NAMES)
def test_any_target_has_a_finite_cost(name):
    # An interval's end may lie beyond what any cost reaches.
    for scale in scales(name, LIGHT):
        middle, spread = scale.forward(LIGHT).mean(), scale.forward(LIGHT).std()
        costs = scale.inverse(middle + spread * np.linspace(-8, 8, 33))
        assert np.isfinite(costs).all()
        assert (np.diff(costs) >= 0).all()


@pytest.mark.parametrize("name", [name for name in NAMES if "half-rank" not in name])
def test_its_slope_is_the_derivative(name):
    step = 1e-6
    for scale in scales(name, LIGHT):
        slope = (scale.forward(LIGHT * (1 + step)) - scale.forward(LIGHT * (1 - step))) / (2 * step * LIGHT)
        np.testing.assert_allclose(scale.log_slope(LIGHT), np.log(slope), atol=1e-6)


@pytest.mark.parametrize("name", HALF_RANKS)
@pytest.mark.parametrize("costs", [LIGHT, HEAVY])
def test_the_better_half_is_what_it_is_without_ranks(name, costs):
    better = costs <= np.median(costs)
    targets = only(name, costs).forward(costs)
    expected = HALF_RANKS[name](costs[better])
    np.testing.assert_allclose(targets[better] - targets.min(), expected - expected.min(), rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("name", HALF_RANKS)
@given(costs=st.lists(st.floats(0.1, 10), min_size=6, max_size=30), power=st.integers(4, 12), seed=st.integers(0, 9))
@settings(max_examples=40, deadline=None, derandomize=True)
def test_how_bad_the_worst_are_changes_nothing(name, costs, power, seed):
    costs = np.unique(costs)[:-1] if len(costs) % 2 else np.unique(costs)
    worst = costs > np.quantile(costs, 0.75)
    once = np.where(worst, 1e20 * costs, costs)
    twice = np.where(worst, 10.0**power * once, costs)
    if np.ptp(costs[costs <= np.median(costs)]) < 1e-3:
        return  # without any spread of the better half there is no scale to draw the worse in to
    first, second = only(name, once).forward(once), only(name, twice).forward(twice)
    np.testing.assert_allclose(second - second.min(), first - first.min(), rtol=1e-9, atol=1e-9)


def test_a_heavy_tail_is_drawn_in_to_the_scale_of_the_better_half():
    logs, targets = np.log(HEAVY), only("log-half-rank", HEAVY).forward(HEAVY)
    median = np.median(logs)
    spread = np.sqrt(np.mean((logs[logs <= median] - median) ** 2))
    assert logs.max() - median > 4 * spread
    assert targets.max() - targets.min() < median - logs.min() + 3 * spread


def test_no_cost_is_pushed_out():
    logs, targets = np.log(LIGHT), only("log-half-rank", LIGHT).forward(LIGHT)
    assert (targets - targets.min() <= logs - logs.min() + 1e-6).all()


@pytest.mark.parametrize("seed", range(3))
def test_box_cox_is_scipys_at_the_power_it_finds(seed):
    costs = 3.0 + 10 * np.random.default_rng(seed).gamma(2.0, size=80)
    mine = standardised(only("box-cox", costs).forward(costs))
    power = float(np.squeeze(stats.boxcox_normmax(costs)))
    assert -1 < power < 2
    np.testing.assert_allclose(mine, standardised(stats.boxcox(costs, power)), atol=1e-3)
    assert stats.probplot(mine)[1][2] > stats.probplot(costs)[1][2]  # nearer to a normal distribution


def test_the_power_of_log_normal_costs_is_the_logarithm():
    costs = np.exp(2 * stats.norm.ppf((np.arange(100) + 0.5) / 100))
    mine = standardised(only("box-cox", costs).forward(costs))
    np.testing.assert_allclose(mine, standardised(np.log(costs)), atol=0.02)


def test_the_power_of_normal_numbers_is_one():
    values = stats.norm.ppf((np.arange(100) + 0.5) / 100)
    mine = standardised(only("yeo-johnson", values).forward(values))
    np.testing.assert_allclose(mine, standardised(values), atol=0.02)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("factor", [1e-6, 1e6])
def test_the_unit_of_the_cost_does_not_matter(name, factor):
    for one, other in zip(scales(name, LIGHT), scales(name, factor * LIGHT), strict=True):
        expected = standardised(one.forward(LIGHT))
        np.testing.assert_allclose(standardised(other.forward(factor * LIGHT)), expected, atol=1e-4)


@pytest.mark.parametrize("name", ["none", "half-rank", "yeo-johnson"])
def test_a_constant_added_to_the_cost_does_not_matter(name):
    for one, other in zip(scales(name, LIGHT), scales(name, LIGHT - 50.0), strict=True):
        expected = standardised(one.forward(LIGHT))
        np.testing.assert_allclose(standardised(other.forward(LIGHT - 50.0)), expected, atol=1e-4)


@pytest.mark.parametrize("name", POSITIVE)
@pytest.mark.parametrize("cost", [0.0, -1.0])
def test_a_cost_that_has_no_logarithm_is_refused(name, cost):
    with pytest.raises(ValueError, match=rf'the cost is {cost} .*: use transform="[a-z-]+" for J <= 0'):
        transform_named(name).check(cost)


def test_a_name_that_is_not_known_is_refused_with_the_known_ones():
    with pytest.raises(ValueError, match="unknown transform 'sqrt'; known are ") as caught:
        transform_named("sqrt")
    assert all(repr(name) in str(caught.value) for name in NAMES)
