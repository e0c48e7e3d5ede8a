"""Methods without flights, good, poor and broken, and a short comparison of them."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from baselines_support import THETA, LinearPlant, study

from socasadi import Circle
from socasadi.baselines import Comparison, Lab, Method
from socasadi.campaign import Pilot


@dataclass(frozen=True)
class Never(Method):
    def offers(self, lab: Lab) -> Iterator[Pilot]:
        yield from ()


@dataclass(frozen=True)
class Broken(Method):
    def offers(self, lab: Lab) -> Iterator[Pilot]:
        yield lab.study.mpc.controller(THETA)
        lab.fly(lab.study.mpc.controller(THETA))
        raise ArithmeticError("it does not add up")


@dataclass(frozen=True)
class Better(Method):
    """A poor controller at once, and the true one after two flights."""

    def offers(self, lab: Lab) -> Iterator[Pilot]:
        poor = lab.study.mpc.controller(THETA * np.where(np.arange(10) % 5 >= 2, 0.5, 1.0))
        yield poor
        lab.fly(poor)
        lab.fly(poor)
        yield lab.study.mpc.controller(THETA)


@dataclass(frozen=True)
class Good(Method):
    def offers(self, lab: Lab) -> Iterator[Pilot]:
        yield lab.study.mpc.controller(THETA)


def comparison(**changes):
    made = {
        "study": study(LinearPlant(noise=1e-3)),
        "tasks": {"circle": Circle(radius=0.03, period=6.0, duration=6.0)},
        "methods": {"better": Better(), "broken": Broken(), "never": Never()},
        "seeds": (0,),
        "checkpoints": (1, 2, 3),
        "flights": 2,
    }
    return Comparison(**made | changes)
