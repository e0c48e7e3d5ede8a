"""All methods are lent the same robot for the same time, and what a campaign does is one of them."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
import pytest
from baselines_support import SYSTEM, THETA, LinearPlant, study, watched

from socasadi import Circle, Pulse
from socasadi.baselines import (
    BudgetSpent,
    Forecast,
    Identified,
    Lab,
    Method,
    ModelSearch,
    Program,
    static_gain,
    tuned,
)
from socasadi.baselines.lab import _tuned
from socasadi.campaign import Pilot
from socasadi.codegen import c_compiler
from socasadi.model import Entry
from socasadi.mpc import DesignError
from socasadi.tune import Optimizer, Space


def test_every_experiment_is_paid_by_the_second_and_none_is_begun_that_cannot_be():
    lab = Lab(study(), (12.0, 30.0))
    controller = lab.study.mpc.controller(THETA)
    lab.probe(5.0)
    lab.fly(controller)
    assert lab.spent == pytest.approx(11.0)
    assert lab.due()  # a flight of 6 s passes the checkpoint at 12 s
    lab.fly(controller)
    assert lab.spent == pytest.approx(17.0)
    assert not lab.due()
    assert lab.due(3)
    cut = lab.fly(controller, give_up=1e-3)
    assert cut.cut is not None
    assert lab.spent == pytest.approx(17.0 + len(cut.tension) * 0.05)
    with pytest.raises(BudgetSpent, match="14 s are needed"):
        lab.probe(14.0)
    assert (lab.flights, lab.probes, lab.failed) == (3, 1, 0)


def test_a_method_without_a_controller_in_its_time_says_how_much_is_missing():
    assert Identified(6.0).controller(Lab(study(), (6.0,))).mpc == study().mpc
    with pytest.raises(BudgetSpent, match="Identified has no controller to offer: 0 s of 5 s are spent; 6"):
        Identified(6.0).controller(Lab(study(), (5.0,)))


def test_what_breaks_off_costs_what_it_flew_and_counts_as_failed():
    class Fragile(LinearPlant):
        def step(self, tension, tip_force=None):
            if np.abs(tension).max() > 3:
                raise RuntimeError("a cable tore")
            return super().step(tension)

    lab = Lab(study(Fragile()), (60.0,))
    episode = lab.fly(lab.study.mpc.controller(THETA))
    assert lab.cost(episode) is None
    assert lab.failed == 1
    assert lab.spent < 1.0


def test_flights_are_records_unless_they_fail_and_their_noise_does_not_come_again():
    class Moody(LinearPlant):
        """Its second flight breaks off."""

        flights = 0

        def reset(self, tip=None, *, seed=None, tension_bounds=(-np.inf, np.inf)):
            type(self).flights += 1
            seeds.append(seed)
            return super().reset(tip, seed=seed)

        def step(self, tension, tip_force=None):
            if self.flights == 2:
                raise RuntimeError("a cable tore")
            return super().step(tension)

    seeds = []
    lab = Lab(study(Moody(noise=1e-3)), (60.0,))
    records = lab.records(lab.study.mpc.controller(THETA), 3)
    assert [len(record.tension) for record in records] == [120, 120]
    assert (lab.flights, lab.failed) == (3, 1)
    with pytest.raises(BudgetSpent):
        list(ModelSearch().offers(lab))
    assert len(set(seeds)) == len(seeds) > 8


def test_noise_does_not_come_again_after_thetas_without_a_controller():
    def build(x):
        if x[0] > 1.0:
            raise DesignError("too much")
        return lab.study.mpc.controller(THETA)

    class Heard(LinearPlant):
        def reset(self, tip=None, *, seed=None, tension_bounds=(-np.inf, np.inf)):
            seeds.append(seed)
            return super().reset(tip, seed=seed)

    seeds = []
    lab = Lab(study(Heard()), (60.0,))
    list(tuned(lab, (Entry("x", "1", 0.5, 2.0, "log"),), build, kind="sobol", most=8))
    assert 0 < lab.flights < 8
    for _ in range(3):
        lab.fly(lab.study.mpc.controller(THETA))
    assert len(set(seeds)) == len(seeds) == lab.flights
    lab.fly(lab.study.mpc.controller(THETA), number=0)
    assert seeds[-1] not in seeds[:-1]


def test_a_robot_that_never_moves_is_not_flown_for_ever():
    class Dead(LinearPlant):
        def reset(self, tip=None, *, seed=None, tension_bounds=(-np.inf, np.inf)):
            raise RuntimeError("no answer")

    lab = Lab(study(Dead()), (60.0,))
    assert list(ModelSearch("random").offers(lab)) == []
    assert lab.flights == lab.failed == 1000
    assert lab.spent == pytest.approx(50.0)  # a sample each
    with pytest.raises(BudgetSpent):
        ModelSearch("random").controller(Lab(study(Dead()), (6.0,)))


def test_no_pulse_disturbs_what_a_model_is_fitted_to():
    class Pushed(LinearPlant):
        def step(self, tension, tip_force=None):
            pushed.append(tip_force)
            return super().step(tension)

    pushed = []
    task = Circle(radius=0.03, period=6.0, duration=6.0, pulse=Pulse(time=1.0, duration=0.5, force=(0.0, 2.0, 0.0)))
    lab = Lab(replace(study(Pushed()), task=task), (60.0,))
    pilot = lab.study.mpc.controller(THETA)
    lab.fly(pilot)
    assert any(force is not None and np.any(force) for force in pushed)
    pushed.clear()
    lab.records(pilot, 1)
    assert len(pushed) == 120
    assert not any(force is not None and np.any(force) for force in pushed)


def test_the_search_of_a_model_is_the_campaign_itself(tmp_path):
    """The same points, flown under the same noise, cut at the same sample, as Study.run has them."""
    made = study(LinearPlant(noise=1e-3))
    result = made.run(tmp_path / "run", progress=None)
    lab = Lab(made, (8 * 6.0,))
    costs, offers = watched(lab), []
    with pytest.raises(BudgetSpent):
        offers.extend(ModelSearch().offers(lab))
    assert costs[: len(result.trials)] == [np.inf if trial.J is None else trial.J for trial in result.trials]


@pytest.mark.parametrize("kind", ["bayesian", "sobol", "random"])
def test_a_search_offers_its_best_at_every_checkpoint(kind):
    lab, offered = Lab(study(LinearPlant(noise=1e-3)), (12.0, 48.0)), []
    with pytest.raises(BudgetSpent):
        offered.extend((lab.spent, pilot) for pilot in ModelSearch(kind).offers(lab))
    early, late = offered[0], offered[-1]
    assert early[0] <= 12.0 < late[0] <= 48.0
    costs = [lab.cost(Lab(lab.study, (1e3,)).fly(pilot, number=99)) for _, pilot in (early, late)]
    assert costs[1] <= 1.02 * costs[0]


def test_what_is_chosen_of_the_same_flights_does_not_depend_on_what_asked_for_them():
    """Not the luckiest of points that learn nothing, but the one that the Bayesian search would believe in, too."""
    lab = Lab(study(LinearPlant(noise=5e-3)), (1e3,))
    entries, flown, mpc = (Entry("x", "1", 0.1, 1e3, "log"),), [], replace(lab.study.mpc, tuned=("R",))
    costs = watched(lab)

    def build(x):
        flown.append(float(x[0]))
        return mpc.controller([*THETA, *x])

    list(tuned(lab, entries, build, kind="sobol", most=25))
    *asked, chosen = flown
    believer = Optimizer(Space(entries), seed=lab.study.seed)
    for x, J in zip(asked, costs, strict=True):
        believer.tell([x], J)
    assert chosen == believer.best_estimated.theta[0]
    assert chosen != asked[int(np.argmin(costs))]


class Weak(LinearPlant):
    """Its cables pull with six tenths of what they are told."""

    def step(self, tension, tip_force=None):
        return super().step(0.6 * np.asarray(tension))


def test_a_search_for_robustness_pays_for_all_robots():
    lab = Lab(study(), (5 * 12.0,))
    costs = watched(lab)
    entries = (Entry("x", "1", 0.5, 2.0, "log"),)
    mpc = replace(lab.study.mpc, tuned=("R",))
    with pytest.raises(BudgetSpent):
        list(tuned(lab, entries, lambda x: mpc.controller([*THETA, *x]), over=(lambda plant: Weak(),), by="worst"))
    assert lab.spent == pytest.approx(60.0)
    assert lab.flights == len(costs) == 10
    # The weak robot is the dearer one in every pair.
    assert all(weak > own for own, weak in zip(costs[::2], costs[1::2], strict=True))


def test_what_counts_of_several_robots_is_the_worst_or_the_mean():
    lab = Lab(study(), (1e3,))
    pilot = lab.study.mpc.controller(THETA)
    own, weak = (lab.cost(lab.fly(pilot, number=1, plant=plant)) for plant in (None, Weak()))
    worst, mean = (_tuned._flown(lab, pilot, [None, Weak()], by, None, 1) for by in ("worst", "mean"))
    assert own is not None
    assert weak is not None
    assert weak > 1.5 * own
    assert (worst.J, worst.at_least) == (pytest.approx(weak), None)
    assert (mean.J, mean.at_least) == (pytest.approx((own + weak) / 2), None)
    # The worst is proven to be hopeless as soon as one is.
    cut = _tuned._flown(lab, pilot, [None, Weak()], "worst", 1.2 * own, 1)
    assert cut.J is None
    assert cut.at_least is not None
    assert cut.at_least >= 1.2 * own


def test_a_lab_without_an_end_is_none():
    for checkpoints in ((), (2.0, 1.0), (0.0,)):
        with pytest.raises(ValueError, match="seconds that ascend from more than 0"):
            Lab(study(), checkpoints)


def test_the_identified_model_is_the_robots_own():
    (pilot,) = Identified(20.0).offers(Lab(study(), (20.0,)))
    n = len(SYSTEM.A)
    gain = static_gain(SYSTEM)
    design = pilot.design
    found = design.C[:, :n] @ np.linalg.solve(np.eye(n) - design.A[:n, :n], design.B[:n]) / pilot.mpc.input_scale
    np.testing.assert_allclose(found, gain, atol=1e-4 * np.abs(gain).max())


def test_a_method_of_ones_own_is_a_few_lines():
    @dataclass(frozen=True)
    class Sleepy(Method):
        def offers(self, lab: Lab) -> Iterator[Pilot]:
            yield lab.study.mpc.controller(THETA)

    (pilot,) = Sleepy().offers(Lab(study(), (6.0,)))
    assert pilot.mpc == study().mpc
    assert Sleepy().information == "data sheet"
    with pytest.raises(TypeError, match="abstract"):
        replace(Method())


@pytest.mark.skipif(c_compiler() is None, reason="the program is solved in C")
@pytest.mark.parametrize("term", ["rate", "normalised", "literal"])
def test_a_program_plans_with_all_that_the_mpc_weighs_and_bounds(term):
    """On the model of the MPC itself it is the MPC: rates weighed and bounded, outputs against their soft bound."""
    bounds = {"rate_bounds": (-16.0, 16.0), "output_bounds": (-0.012, 0.012)}
    weights = {"rate_weight": 0.3, "slack_linear": 20.0, "slack_weight": 3e3, "R": 1e-4 if term == "literal" else 0.3}
    made = study(LinearPlant(), terminal=None, horizon=8, input_term=term, **bounds, **weights)
    mpc, N, scale = made.mpc, 8, 10.0
    model = mpc.system(THETA)
    pilot, plant = mpc.controller(THETA), LinearPlant()
    response = [model.C @ np.linalg.matrix_power(model.A, k) for k in range(N + 1)]
    by_input = np.zeros((2 * N, 3 * N))
    for k in range(N):
        for j in range(k + 1):
            seen = response[k - j] @ model.B + (model.D if j == k else 0)
            by_input[2 * k : 2 * k + 2, 3 * j : 3 * j + 3] = scale * seen
    order = len(model.A)
    pick = np.split(np.eye(order + 2 * N + 3), [order, order + 2 * N])
    forecast = Forecast(
        input=(np.eye(3 * N), np.zeros((3 * N, order + 2 * N + 3))),
        output=(by_input, np.vstack(response[1:]) @ pick[0]),
        reference=pick[1],
        before=pick[2],
    )
    program = Program(mpc, forecast)
    y, at_bound, beyond = plant.reset(), 0, 0
    pilot.reset(0.0)
    before = np.zeros(3)
    for t in range(40):
        wanted = 0.015 * np.stack([np.sin(0.3 * (t + np.arange(N))), np.cos(0.3 * (t + np.arange(N)))], axis=1)
        u = pilot.step(y, wanted)
        plan = program.inputs(np.concatenate([plant.x, wanted.ravel(), before / scale]), pilot.info)
        np.testing.assert_allclose(plan[0], u, atol=5e-3)
        at_bound += np.isclose(np.abs(u - before), 0.8).any()
        y, before = plant.step(u), u
        beyond += np.abs(y).max() > 0.0119
    assert at_bound > 2
    assert beyond > 2
