import numpy as np
import pytest

from socasadi.tune._transform import transform_named

half_rank = transform_named("log-half-rank")
random = np.random.default_rng(0)
LIGHT = np.exp(random.normal(size=60))
# Thirty good costs within a decade or two, and thirty that differ by as many decades again.
HEAVY = np.exp(np.concatenate([random.normal(size=30), random.uniform(10, 40, size=30)]))


@pytest.mark.parametrize("costs", [LIGHT, HEAVY, np.array([3.0]), np.array([2.0, 2.0, 5.0])])
def test_the_order_of_costs_is_kept(costs):
    targets = half_rank.apply(costs)
    assert np.isfinite(targets).all()
    order = np.argsort(costs, kind="stable")
    assert (np.diff(targets[order])[np.diff(costs[order]) > 0] > 0).all()


@pytest.mark.parametrize("costs", [LIGHT, HEAVY])
def test_the_better_half_is_log_J(costs):
    better = costs <= np.median(costs)
    np.testing.assert_array_equal(half_rank.apply(costs)[better], np.log(costs[better]))


def test_a_heavy_tail_is_drawn_in_to_the_scale_of_the_better_half():
    logs, targets = np.log(HEAVY), half_rank.apply(HEAVY)
    median = np.median(logs)
    spread = np.sqrt(np.mean((logs[logs <= median] - median) ** 2))
    assert logs.max() - median > 4 * spread
    assert targets.max() - median < 3 * spread


def test_no_cost_is_pushed_out():
    assert (half_rank.apply(LIGHT) <= np.log(LIGHT)).all()


def test_a_cost_that_has_no_logarithm_is_refused():
    with pytest.raises(ValueError, match="log J is modelled"):
        half_rank.check(-1.0)
