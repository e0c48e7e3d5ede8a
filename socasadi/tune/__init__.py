"""Bayesian optimisation of an expensive cost over a box: space, Gaussian process, acquisition, ask/tell.

Knows nothing of robots. GPy gives the marginal likelihood; prediction and acquisition are in closed form.

    space = Space([Parameter("frequency", "rad/s", 2, 10, "log"), Parameter("gain", "m/N", -0.012, 0.012)])
    search = Optimizer(space, seed=1)
    for _ in range(110):
        theta = search.ask()
        search.tell(theta, cost(theta))
    search.best, search.best_estimated

`surrogate` is what is believed of the cost, `acquisition` where to ask next; each of their parts has a name by which an
`Optimizer` is made of others.
"""

from ._optimizer import Optimizer
from ._search import Estimate, Search, Timings, Trial
from ._sensitivity import Sensitivity
from ._sobol import RandomSearch, SobolSearch
from ._space import Parameter, ParameterLike, Space

__all__ = [
    "Estimate",
    "Optimizer",
    "Parameter",
    "ParameterLike",
    "RandomSearch",
    "Search",
    "Sensitivity",
    "SobolSearch",
    "Space",
    "Timings",
    "Trial",
]
