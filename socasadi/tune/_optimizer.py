"""Bayesian optimisation with an ask/tell interface."""

from __future__ import annotations

import collections
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from threadpoolctl import threadpool_limits

from ._belief import Belief, Believer, Start, last_full_fit
from ._choice import Chooser
from ._search import Estimate, History, Timings, Trial, check_seed
from ._sensitivity import Sensitivity, sensitivity
from ._sobol import SobolPoints
from ._space import Space
from .acquisition import acquisition_named
from .surrogate import FitSettings, import_gpy, transform_named


class Optimizer:
    """Minimise a cost over a box with as few experiments as possible.

    First the points of `initial`, then scrambled Sobol points until `seed_points` trials are told, then the
    maximiser of the acquisition over a Gaussian process of the transformed, standardised costs.

    **What is asked is a pure function of the settings, the seed, the ordered list of told trials, and the ordered list
    of pending thetas.** Nothing else is remembered: random numbers derive from (seed, numbers of trials told and
    pending), and hyperparameters from the told trials. A search that is rebuilt by telling it the stored trials again
    (which costs next to nothing) goes on with the very point, bit for bit, that there would have been; two asks
    without a tell between give the same point. (On one machine: another linear algebra library may change last bits.)

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
    acquisition : {"log_ei", "ei", "noisy_ei", "ucb"}
        Expected improvement by its logarithm or plain; averaged over what noise may have hidden at the told points;
        the confidence bound.
    transform : {"power", "power-half-rank", "half-rank", "log", "log-half-rank", "box-cox", "yeo-johnson", "none"}
        What is modelled: J, its logarithm, or a power of it: "power" takes the Yeo-Johnson power, from the linear one
        to the reciprocal (for J > 0 the Box-Cox ones, too), under which the process finds the costs most probable, and
        J itself if in doubt; "box-cox" and "yeo-johnson" the one that makes them most normal. "half-rank" keeps of
        the worse half little more than the order. Logarithm and "box-cox" need J > 0.
    mean : {"constant", "zero"}
        Learned constant, or zero, of the standardised targets.
    additive : bool
        Until noise is seen, at one ask of four: beside the kernel of all coordinates a sum of one-dimensional ones
        (Duvenaud et al. 2011).
    priors : bool
        On top of the marginal likelihood: lengthscales scaled with sqrt(d) (Hvarfner et al. 2024), akin to each other,
        and some noise; until noise is seen, the last two not at one ask of four.
    noise : "fitted" or float
        Fitted, or the fixed variance of the observation noise on the scale of the standardised targets. Deviations
        that are told with the trials come on top.
    warp : bool
        Fit a monotone warping of each coordinate, too.
    limits : mapping of str to float, optional
        Quantities measured in each experiment that have to stay at or below a limit. Each gets a Gaussian process, and
        the acquisition is weighed with the probability that all are kept.
    admissible : callable, optional
        Whether theta (d,) may be asked at all, known before any experiment; a pure function, and cheap: a few dozen
        calls an ask, at worst some thousand.
    active_set : int, optional
        Beyond so many trials the process is fitted to this many of them: the better half, and of the rest some at
        random.
    repeat : bool
        Ask the best told point again when the noise matters.

    Raises
    ------
    ValueError
        An unknown name (the message lists the known ones) or a setting out of range.

    Notes
    -----
    Failed trials teach a Gaussian process of their own where experiments fail, and the acquisition is weighed with the
    probability of success, the more so the more trials in a row were lost; they never are the best. While there are
    only failures the Sobol sequence goes on. Trials that were cut count as lower bounds. The best told point is asked
    again after 20, 40, 80, ... trials, which shows how much noise there is, and whenever the model expects more of that
    than of any new point; a cost that came out the same to ten digits is taken for free of noise, and no point is asked
    again.
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
        transform: str = "power",
        mean: str = "constant",
        additive: bool = True,
        priors: bool = True,
        noise: float | Literal["fitted"] = "fitted",
        warp: bool = False,
        limits: Mapping[str, float] | None = None,
        admissible: Callable[[NDArray], bool] | None = None,
        active_set: int = 300,
        repeat: bool = True,
    ) -> None:
        self._seed = check_seed(seed)
        self._seed_points = _count("seed_points", seed_points)
        self._initial = [space.check(theta) for theta in initial]
        self._transform = transform_named(transform)
        self._history = History(space, limits)
        self._believer = Believer(
            space,
            self._transform,
            FitSettings(kernel, mean, additive, priors, None if noise == "fitted" else noise, warp),
            self._history.limits,
            _count("active_set", active_set),
            self._seed,
        )
        chosen = acquisition_named(acquisition)
        self._chooser = Chooser(space, chosen, self._history.limits, admissible, repeat, self._seed)
        for theta in self._initial:
            if not self._chooser.may_ask(theta):
                raise ValueError(f"the start point {theta.tolist()} does not keep the conditions: leave it out")
        self._sobol = SobolPoints(space, self._seed, admissible)
        self._timings = Timings()
        self._belief: Belief | None = None
        self._estimate: tuple[Belief, Estimate] | None = None
        self._full: tuple[int, Start] | None = None
        self._asked: tuple[tuple[int, bytes], NDArray] | None = None

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
            additive=False,
            priors=False,
            noise=0.01**2,
            repeat=False,
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
        """The best observed trial that kept all limits, or None."""
        return self._history.best

    @property
    def best_estimated(self) -> Estimate | None:
        """The told theta whose cost without noise is believed to be the lowest, and how sure that is.

        Of trials that kept all limits; None before there are two costs. The luckiest of many noisy costs is too good to
        be true; this is not. Of up to twenty trials that show no noise it is the best observed.
        """
        if self.best is None or sum(trial.cost is not None for trial in self.trials) < 2:
            return None
        belief = self._believe()
        if self._estimate is None or self._estimate[0] is not belief:
            with threadpool_limits(1):
                self._estimate = (belief, self._believer.estimate(belief, self._chooser.keeps_limits))
        return self._estimate[1]

    @property
    def timings(self) -> Timings:
        """Seconds of the last ask that computed a point, without the import of GPy at the first fit."""
        return self._timings

    @property
    def hyperparameters(self) -> dict[str, float]:
        """The last fit's hyperparameters as plain numbers, for a log; empty before the first fit.

        Until noise is seen, fits are of several kinds, by lot: with the sum (``additive`` above 0) or without.

        Lengthscales are in the unit cube, under "lengthscale:NAME"; mean, variance, additive (the variance of the sum
        of one-dimensional kernels) and noise (a variance) refer to the standardised targets.
        """
        if self._belief is None:
            return {}
        hyper = self._belief.cost.hyperparameters
        named = {name: getattr(hyper, name) for name in ("mean", "variance", "additive", "noise")}
        for name, value in zip(self.space.names, hyper.lengthscales, strict=True):
            named[f"lengthscale:{name}"] = float(value)
        return named

    def ask(self, pending: Sequence[ArrayLike] = ()) -> NDArray:
        """Return the next theta (d,), inside the bounds.

        Parameters
        ----------
        pending : sequence of array-like (d,), optional
            Thetas that are asked and not yet told, in the order of asking: experiments that run at the same time.
            The merit of the next one is averaged over what may come out of them (Snoek, Larochelle and Adams 2012,
            "Practical Bayesian optimization of machine learning algorithms", section 3.2).
        """
        waiting = np.array([self.space.check(theta) for theta in pending]).reshape(-1, self.space.dimension)
        state = (len(self.trials), waiting.tobytes())
        if self._asked is None or self._asked[0] != state:
            self._asked = (state, self._next(waiting))
        return self._asked[1].copy()

    def ask_batch(self, count: int, pending: Sequence[ArrayLike] = ()) -> NDArray:
        """Return `count` thetas (count, d) for experiments that run side by side: each is asked with those before it
        pending."""
        asked: list[ArrayLike] = []
        for _ in range(_count("count", count)):
            asked.append(self.ask([*pending, *asked]))
        return np.array(asked)

    def tell(
        self,
        theta: ArrayLike,
        cost: float | None = None,
        *,
        failed: bool = False,
        at_least: float | None = None,
        measured: Mapping[str, float] | None = None,
        deviation: float | None = None,
    ) -> None:
        """Record a trial: its cost, or that it failed, or what its cost is at least.

        Parameters
        ----------
        theta : array-like (d,)
            Inside the bounds; it need not have been asked.
        cost : float, optional
            J, to be minimised.
        failed : bool
            The experiment gave no cost.
        at_least : float, optional
            The experiment was cut: J is at least this.
        measured : mapping of str to float, optional
            Value of each quantity that has a limit; all of them with a cost.
        deviation : float, optional
            Standard deviation of this cost's noise, in its unit, where it is known.

        Raises
        ------
        ValueError
            A theta that `Space.check` refuses; a number that is not finite; anything but one of cost, failed and
            at_least; a quantity without a limit, or one with a limit missing; J <= 0 where its logarithm is modelled.
            Nothing is recorded then.
        """
        trial = self._history.check(theta, cost, failed, at_least, measured, deviation)
        for value in (trial.cost, trial.at_least):
            if value is not None:
                self._transform.check(value)
        self._history.append(trial)

    def predict(self, theta: ArrayLike) -> tuple[float, float]:
        """Return mean and standard deviation of the transformed cost, without noise.

        The scale is that of the transform, whose unit and origin follow the costs told: good for comparing thetas.

        Raises
        ------
        ValueError
            While no told trial has a cost.
        """
        belief = self._told()
        mean, std = belief.cost.predict(self.space.to_unit(theta)[None, :])
        return belief.data.location + belief.data.scale * float(mean[0, 0]), belief.data.scale * float(std[0])

    def sensitivity(self, theta: ArrayLike) -> Sensitivity:
        """Return how the cost depends on each entry about `theta` (d,), and where the best of each may lie.

        Raises
        ------
        ValueError
            While no told trial has a cost.
        """
        return sensitivity(self._told(), self.space, self.space.check(theta), self._seed)

    def _told(self) -> Belief:
        """What is believed; ValueError while no told trial has a cost."""
        if not any(trial.cost is not None for trial in self.trials):
            raise ValueError("nothing can be predicted: tell a trial with a cost first")
        return self._believe()

    def _next(self, waiting: NDArray) -> NDArray:
        told = len(self.trials)
        count = told + len(waiting)
        self._timings = Timings()
        if (first := self._start_left(waiting)) is not None:
            return first
        if count < self._seed_points or not any(trial.cost is not None for trial in self.trials):
            return self._sobol[count - len(self._initial)]
        import_gpy()
        start = time.perf_counter()
        belief = self._believe()
        fitted = time.perf_counter()
        # Matrices this small only lose time on threads, and last bits with their number.
        with threadpool_limits(1):
            units = np.array([self.space.to_unit(theta) for theta in waiting])
            theta = self._chooser.choose(belief, units.reshape(-1, self.space.dimension))
        self._timings = Timings(fitted - start, time.perf_counter() - fitted)
        return theta

    def _start_left(self, waiting: NDArray) -> NDArray | None:
        """The first of the start points that is neither told nor pending."""
        met = collections.Counter(theta.tobytes() for theta in (*(trial.theta for trial in self.trials), *waiting))
        for theta in self._initial:
            if not met[theta.tobytes()]:
                return theta
            met[theta.tobytes()] -= 1
        return None

    def _believe(self) -> Belief:
        """What the told trials say: fitted once for each number of them."""
        told = len(self.trials)
        if self._belief is None or len(self._belief.trials) != told:
            with threadpool_limits(1):
                self._belief = self._believer.belief(self.trials, self._start(last_full_fit(told)))
        return self._belief

    def _start(self, full: int) -> Start | None:
        """Where the descent starts: at what the last full fit found, None where this is one."""
        before = self.trials[:full]
        if full == len(self.trials) or not any(trial.cost is not None for trial in before):
            return None
        if self._full is None or self._full[0] != full:
            known = self._belief
            at_hand = known is not None and len(known.trials) == full
            self._full = (full, known.found if known and at_hand else self._believer.cost(before, None)[2])
        return self._full[1]


def _count(name: str, value: int) -> int:
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or value < 1:
        raise ValueError(f"{name} is {value!r}: it must be an integer, 1 or more")
    return int(value)
