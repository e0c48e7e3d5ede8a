"""What a method may do, and what it is told where it does something else."""

import re
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
import pytest
from baselines_support import THETA, LinearPlant, study
from comparison_support import Never, comparison

from socasadi.baselines import Lab, Law, Method, Summary, fly_cell, tuned, worth
from socasadi.campaign import Pilot
from socasadi.model import Entry


class Eager(Law):
    """As much as it can of the first input, whatever the bounds."""

    force = 50.0

    def begin(self):
        """It remembers nothing."""

    def act(self, y, reference):
        return np.array([self.force, 0.0, 0.0])

    @property
    def allowed(self):
        return np.full(3, -100.0), np.full(3, 100.0)


class Two(Eager):
    def act(self, y, reference):
        return np.zeros(2)


class Blank(Eager):
    def step(self, y, reference, disturbance=None):
        return np.full(3, np.nan)


@pytest.mark.parametrize(
    ("law", "why"),
    [
        (Eager, r"asks for 50 N of input 1, for which the study's bounds leave -10 to 10 N"),
        (Two, r"act gave array\(\[0., 0.\]\) for the inputs, of shape \(2,\); \(3,\) is needed"),
        (Blank, r"gave array\(\[nan, nan, nan\]\) for its inputs; \(3,\) finite numbers"),
    ],
)
def test_inputs_that_no_study_allows_fail_the_flight_wherever_it_is(law, why):
    @dataclass(frozen=True)
    class Careless(Method):
        tune: bool

        def offers(self, lab: Lab) -> Iterator[Pilot]:
            if self.tune:
                return tuned(lab, [Entry("x", "1", 0.0, 1.0)], lambda x: law(lab.study.mpc))
            return iter([law(lab.study.mpc)])

    made = comparison(methods={"at once": Careless(False), "tuned": Careless(True)})
    at_once, searched = (fly_cell(made, "circle", name, 0) for name in made.methods)
    assert at_once["points"][-1]["J"] == [None, None]
    assert re.search(why, at_once["points"][-1]["failure"])
    assert searched["points"] == [None] * 3
    assert re.match(rf"(\d+) of \1 flights failed, the first by ValueError: .*{why}", searched["lacking"])
    assert searched["broke"] is at_once["lacking"] is None


def test_rates_are_kept_as_well():
    class Sudden(Eager):
        force = 8.0

    made = study(LinearPlant(), rate_bounds=(-20.0, 20.0))
    flown = worth(made, Sudden(made.mpc), 1)[0]
    assert "asks for 8 N of input 1, for which the study's bounds leave -1 to 1 N" in str(flown.failure)
    assert worth(made, made.mpc.controller(THETA), 1)[0].failure is None

    class Reusing(Sudden):
        """Its inputs come in the same array every time."""

        array, sign = np.zeros(3), 1.0

        def step(self, y, reference, disturbance=None):
            self.sign = -self.sign
            self.array[:] = self.sign * 0.9
            return self.array

    assert "asks for 0.9 N of input 1" in str(worth(made, Reusing(made.mpc), 1)[0].failure)


def test_what_is_no_generator_or_of_another_sample_time_is_told_as_that():
    @dataclass(frozen=True)
    class Returns(Method):
        def offers(self, lab: Lab) -> Iterator[Pilot]:
            return lab.study.mpc.controller(THETA)  # pyright: ignore[reportReturnType]

    @dataclass(frozen=True)
    class Slow(Method):
        def offers(self, lab: Lab) -> Iterator[Pilot]:
            yield replace(lab.study.mpc, sample_time=0.1).controller(THETA)

    made = comparison(methods={"returns": Returns(), "slow": Slow()})
    broke = [fly_cell(made, "circle", name, 0)["broke"] for name in made.methods]
    assert "offers of Returns returned" in broke[0]
    assert "let it yield controllers" in broke[0]
    assert "samples of 0.1 s, the study 0.05 s" in broke[1]
    with pytest.raises(TypeError, match="let it yield"):
        Returns().controller(Lab(study(), (6.0,)))


def test_seeds_on_which_neither_has_a_controller_count_for_nobody():
    made = comparison(methods={"never": Never(), "too": Never()})
    cells = [fly_cell(made, *names) for names in made.cells]
    assert Summary.of(cells, ["circle"], ["never", "too"]).rivalries() == {}
