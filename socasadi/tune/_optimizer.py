"""Bayesian optimisation with an ask/tell interface."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from threadpoolctl import threadpool_limits

from ._acquisition import acquisition_named
from ._fit import FitSettings, fit, import_gpy
from ._maximise import maximise
from ._posterior import Posterior
from ._search import History, Timings, Trial, check_seed
from ._sobol import SobolPoints
from ._space import Space
from ._targets import Targets, targets
from ._transform import transform_named

_INCUMBENTS = 5


class Optimizer:
    """Minimise a cost over a box with as few experiments as possible.

    First the points of `initial`, then scrambled Sobol points until `seed_points` trials are told, then the
    maximiser of the acquisition over a Gaussian process of the transformed, standardised costs.

    **What is asked is a pure function of the settings, the seed and the ordered list of told trials.**
    Nothing else is remembered: random numbers derive from (seed, number of trials told), and hyperparameters
    are fitted anew at every ask from starts that do not depend on earlier fits. A search that is rebuilt by
    telling it the stored trials again (which costs next to nothing) goes on with the very point, bit for bit,
    that there would have been; two asks without a tell between give the same point. (On one machine: another
    linear algebra library may change last bits.)

    Parameters
    ----------
    space : Space
    seed : int, optional
        Integer, 0 or more.
    seed_points : int, optional
        Trials before the first fit; the points of `initial` count among them.
    initial : sequence of array-like (d,), optional
        Start points inside the bounds that are asked first, all of them, in order.
    kernel : {"matern52", "rbf"}
        With one lengthscale a dimension.
    acquisition : {"log_ei", "ei"}
    transform : {"log-half-rank", "log", "none"}
        What is modelled: log J with the worse half replaced by its ranks, log J (both need J > 0), or J.
    mean : {"constant", "zero"}
        Learned constant, or zero, of the standardised targets.
    priors : bool
        Lengthscale priors scaled with sqrt(d) (Hvarfner et al. 2024) on top of the marginal likelihood.
    noise : "fitted" or float
        Fitted, or the fixed variance of the observation noise on the scale of the standardised targets.

    Raises
    ------
    ValueError
        An unknown name (the message lists the known ones) or a setting out of range.

    Notes
    -----
    A failed trial stands in the model as the worst cost seen plus a tenth of the range seen, on the
    transformed scale, so that it steers the search away, as in Vizier (Song et al. 2024, arXiv 2408.11527);
    it is never the best. While there are only failures the Sobol sequence goes on.
    """

    def __init__(
        self,
        space: Space,
        *,
        seed: int = 0,
        seed_points: int = 10,
        initial: Sequence[ArrayLike] = (),
        kernel: str = "matern52",
        acquisition: str = "log_ei",
        transform: str = "log-half-rank",
        mean: str = "constant",
        priors: bool = True,
        noise: float | Literal["fitted"] = "fitted",
    ) -> None:
        if isinstance(seed_points, bool) or not isinstance(seed_points, int | np.integer) or seed_points < 1:
            raise ValueError(f"seed_points is {seed_points!r}: it must be an integer, 1 or more")
        self._seed = check_seed(seed)
        self._seed_points = int(seed_points)
        self._initial = [space.check(theta) for theta in initial]
        self._acquisition = acquisition_named(acquisition)
        self._transform = transform_named(transform)
        self._fit_settings = FitSettings(kernel, mean, priors, None if noise == "fitted" else noise)
        self._history = History(space)
        self._sobol = SobolPoints(space.dimension, self._seed)
        self._timings = Timings()
        self._fitted: tuple[int, Posterior, Targets] | None = None
        self._asked: tuple[int, NDArray] | None = None

    @classmethod
    def paper(cls, space: Space, seed: int = 0, *, seed_points: int = 10) -> Optimizer:
        """Return the optimiser of Pal, He and Wei 2022 (arXiv 2210.08780), to the letter.

        Zero mean, Gaussian kernel, plain expected improvement, noise variance 0.01^2, hyperparameters by
        maximum marginal likelihood, the cost as it is (standardised, without which a zero mean would be
        arbitrary). Their "active set" of 300 points has no effect on fewer trials: the process is exact.
        """
        return cls(
            space,
            seed=seed,
            seed_points=seed_points,
            kernel="rbf",
            acquisition="ei",
            transform="none",
            mean="zero",
            priors=False,
            noise=0.01**2,
        )

    @property
    def space(self) -> Space:
        """The box that is searched."""
        return self._history.space

    @property
    def trials(self) -> tuple[Trial, ...]:
        """All told trials, in order."""
        return self._history.trials

    @property
    def best(self) -> Trial | None:
        """The best observed trial that did not fail, or None."""
        return self._history.best

    @property
    def timings(self) -> Timings:
        """Seconds of the last ask that computed a point, without the import of GPy at the first fit."""
        return self._timings

    @property
    def hyperparameters(self) -> dict[str, float]:
        """The last fit's hyperparameters as plain numbers, for a log; empty before the first fit.

        Lengthscales are in the unit cube, under "lengthscale:NAME"; mean, variance and noise (a variance)
        refer to the standardised targets.
        """
        if self._fitted is None:
            return {}
        hyper = self._fitted[1].hyperparameters
        named = {"mean": hyper.mean, "variance": hyper.variance, "noise": hyper.noise}
        for name, value in zip(self.space.names, hyper.lengthscales, strict=True):
            named[f"lengthscale:{name}"] = float(value)
        return named

    def ask(self) -> NDArray:
        """Return the next theta (d,), inside the bounds; it depends on the told trials only."""
        count = len(self.trials)
        if self._asked is None or self._asked[0] != count:
            self._asked = (count, self._next())
        return self._asked[1].copy()

    def tell(self, theta: ArrayLike, cost: float | None = None, *, failed: bool = False) -> None:
        """Record a trial.

        Parameters
        ----------
        theta : array-like (d,)
            Inside the bounds; it need not have been asked.
        cost : float, optional
            J, to be minimised.
        failed : bool
            The experiment gave no cost.

        Raises
        ------
        ValueError
            A theta that `Space.check` refuses; a cost that is not finite, missing, told together with
            failed=True, or not positive when log J is modelled. Nothing is recorded then.
        """
        trial = self._history.check(theta, cost, failed)
        if trial.cost is not None:
            self._transform.check(trial.cost)
        self._history.append(trial)

    def predict(self, theta: ArrayLike) -> tuple[float, float]:
        """Return mean and standard deviation of the transformed cost, without noise; see `transform`.

        Raises
        ------
        ValueError
            While no told trial has a cost.
        """
        if self.best is None:
            raise ValueError("nothing can be predicted: tell a trial with a cost first")
        posterior, aim = self._model()
        mean, std = posterior.predict(self.space.to_unit(theta)[None, :])
        return aim.location + aim.scale * float(mean[0]), aim.scale * float(std[0])

    def _next(self) -> NDArray:
        count = len(self.trials)
        self._timings = Timings()
        if count < len(self._initial):
            return self._initial[count]
        if count < self._seed_points or self.best is None:
            return self.space.from_unit(self._sobol[count - len(self._initial)])
        import_gpy()
        start = time.perf_counter()
        posterior, aim = self._model()
        fitted = time.perf_counter()
        order = np.argsort(aim.values, kind="stable")[:_INCUMBENTS]
        with threadpool_limits(1):
            unit = maximise(self._acquisition, posterior, aim.best, posterior.points[order], self._generator(1))
        self._timings = Timings(fitted - start, time.perf_counter() - fitted)
        return self.space.from_unit(unit)

    def _model(self) -> tuple[Posterior, Targets]:
        count = len(self.trials)
        if self._fitted is None or self._fitted[0] != count:
            points = np.array([self.space.to_unit(trial.theta) for trial in self.trials])
            aim = targets(self.trials, self._transform)
            # Matrices this small only lose time on threads, and last bits with their number.
            with threadpool_limits(1):
                posterior = fit(points, aim.values, self._fit_settings, self._generator(0))
            self._fitted = (count, posterior, aim)
        return self._fitted[1:]

    def _generator(self, purpose: int) -> np.random.Generator:
        return np.random.default_rng([self._seed, len(self.trials), purpose])
