"""Learning from flight to flight."""

from dataclasses import replace

import numpy as np
import pytest
from baselines_support import THETA, LinearPlant, study, watched

from socasadi import Cost
from socasadi.baselines import BudgetSpent, IterativeLearning, Lab, WeightSearch
from socasadi.baselines.lab import believed
from socasadi.baselines.methods import _learning


@pytest.mark.parametrize("term", ["rate", "normalised", "literal"])
def test_learning_knows_what_the_cost_weighs_of_the_inputs(term):
    """The curvature by finite differences of J itself, in a loop without noise: the first step is Newton's."""
    cost = Cost(input_term=term, R=1.0 if term == "rate" else 0.5 if term == "normalised" else 5e-3)
    made = replace(study(LinearPlant(), preview=1), cost=cost)
    lab = Lab(made, (60.0,))
    costs = watched(lab)
    IterativeLearning(WeightSearch(probing=10.0, most=1), caution=0.0).controller(lab)
    assert min(costs[2:]) < 0.97 * costs[1]


@pytest.mark.parametrize("bound", [10.0, 3.0])
def test_learning_from_flight_to_flight_lowers_the_cost_where_nothing_else_changes(bound):
    """Without noise, on a circle that the loop cannot foresee well, and that is partly out of reach with 3 N."""
    made = study(LinearPlant(), preview=1, input_bounds=(-bound, bound))
    lab = Lab(made, (200.0,))
    costs = watched(lab)
    pilot = IterativeLearning(WeightSearch(probing=10.0, most=1), caution=0.3).controller(lab)
    used = Lab(made, (10.0,)).fly(pilot).tension
    assert (np.mean(np.abs(used).max(axis=1) > bound - 1e-6) > 0.1) == (bound < 10)
    assert np.all(np.diff(costs[1:]) < 1e-3 * costs[1])
    assert costs[-1] < 0.95 * costs[1]


@pytest.mark.parametrize("preview", [1, None, 60])
@pytest.mark.parametrize("doubt", [1.0, 1e-4])
def test_learning_knows_how_the_loop_answers_however_far_it_sees_and_slowly_it_settles(doubt, preview):
    """By a flight on the model itself with and without a shift; little is corrected if the observer doubts nothing."""
    mpc = replace(study(preview=preview, horizon=preview or 10).mpc, tuned=("input_noise", "disturbance_noise"))
    controller, count = mpc.controller([*THETA, doubt, doubt]), 400
    model = believed(controller)
    answers = _learning._responses(model, count) @ _learning._answers(controller, model, count)
    flown = {}
    for when in (None, 70, count - 1):
        shift, plant, outputs = np.zeros((count, 2)), LinearPlant(), []
        if when is not None:
            shift[when, 0] = 1e-4
        pilot = _learning._Shifted(controller, shift)
        pilot.reset()
        y = plant.reset()
        for _ in range(count):
            y = plant.step(pilot.step(y, np.zeros((mpc.reference_rows, 2))))
            outputs.append(y)
        flown[when] = np.ravel(outputs)
    for when in (70, count - 1):
        measured = (flown[when] - flown[None]) / 1e-4
        np.testing.assert_allclose(answers[:, 2 * when], measured, atol=1e-3 * np.abs(measured).max())


def test_learning_averages_the_noise_of_the_sensor_out():
    """What is learned under 3 mm of noise costs, without it, little more than what is learned without."""
    still = Lab(study(LinearPlant(), preview=1), (1e3,))
    learned = []
    for noise in (0.0, 3e-3):
        lab, offered = Lab(study(LinearPlant(noise=noise), preview=1), (400.0,)), []
        with pytest.raises(BudgetSpent):
            offered.extend(IterativeLearning(WeightSearch(probing=40.0, most=1)).offers(lab))
        learned.append([still.cost(still.fly(pilot)) for pilot in (offered[2], offered[-1])])
    assert learned[1][1] < 1.05 * learned[0][1] < 0.9 * learned[0][0]
