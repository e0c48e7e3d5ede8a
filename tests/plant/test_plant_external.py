import numpy as np
import pytest

from socasadi.plant import Camera, ExternalPlant, ExternalPlantError, Plant, SimulatedPlant
from socasadi.rod import Rod


def test_a_robot_that_python_never_touches_is_a_plant_that_refuses_to_move():
    arm = ExternalPlant(0.02, inputs=4, outputs=2, name="the arm in room 12")
    assert isinstance(arm, Plant)
    np.testing.assert_array_equal(arm.tension, np.zeros(4))
    for move in (arm.prepare, arm.reset, lambda: arm.step(np.zeros(4))):
        with pytest.raises(ExternalPlantError, match=r"the arm in room 12 cannot be flown from here: bring .* `tell`"):
            move()


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"sample_time": 0}, "sample_time is 0 s, but must be above zero"),
        ({"sample_time": "fast"}, "sample_time is 'fast' s"),
        ({"inputs": 0}, "inputs is 0, but must be a positive integer"),
        ({"outputs": 1.5}, "outputs is 1.5, but must be a positive integer"),
        ({"name": ""}, "name is '', but must be a text"),
        ({"output_unit": 3}, "output_unit is 3, but must be a text"),
    ],
)
def test_nonsense_is_refused_in_a_sentence(settings, words):
    with pytest.raises(ValueError, match=words):
        ExternalPlant(**{"sample_time": 0.05, "inputs": 3, "outputs": 2} | settings)


def test_a_plant_says_what_its_outputs_are_in():
    rod = Rod.preset("paper")
    assert SimulatedPlant(rod).output_unit == "m"
    assert SimulatedPlant(rod, output=Camera((1.6, 0, 0), (0.6, 0, 0), 500)).output_unit == "px"
    assert ExternalPlant(0.05, 3, 2, output_unit="mm").output_unit == "mm"
