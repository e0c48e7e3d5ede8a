"""Fitting the Gaussian process: GPy gives the marginal likelihood and its gradient, here it is maximised.

GPy's own optimiser is not used: it costs several times its likelihood, its restarts draw from numpy's global
random state, and its parameters have no box. Here every hyperparameter but the mean is a logarithm in a box.
"""

from __future__ import annotations

import functools
import warnings
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular
from scipy.optimize import minimize

from ._kernel import kernel_named, lengthscale_prior
from ._named import choose
from ._posterior import Hyperparameters, Posterior

MEANS = {"constant": 1, "zero": 0}  # how many numbers of each are fitted

# In the unit cube and for standardised targets. Without these boxes smooth data drive the noise to 1e-35 and
# constant targets the variance to 1e-10.
MEAN_BOUNDS = (-5.0, 5.0)
VARIANCE_BOUNDS = (1e-2, 1e2)
LENGTHSCALE_BOUNDS = (1e-2, 1e3)
NOISE_BOUNDS = (1e-6, 1.0)


@dataclass(frozen=True)
class FitSettings:
    """How the hyperparameters are found.

    `noise` is None (fitted) or a fixed variance on the standardised scale; `priors` puts lengthscale priors
    scaled with sqrt(d) on top of the likelihood, without them it is pure maximum likelihood; of `screened`
    random starts the best `restarts` are optimised, beside the fixed start.
    """

    kernel: str = "matern52"
    mean: str = "constant"
    priors: bool = True
    noise: float | None = None
    screened: int = 60
    restarts: int = 4
    iterations: int = 100

    def __post_init__(self) -> None:
        kernel_named(self.kernel)
        choose("mean", MEANS, self.mean)
        number = isinstance(self.noise, float | int | np.number) and not isinstance(self.noise, bool)
        if self.noise is not None and not (number and np.isfinite(self.noise) and self.noise > 0):
            raise ValueError(
                f'noise is {self.noise!r}: give "fitted", or a positive variance of the standardised targets'
            )


@functools.cache
def import_gpy() -> Any:
    """Import GPy when it is first needed: it takes seconds, and resets the process's warning filters."""
    with warnings.catch_warnings():
        import GPy
    return GPy


class _Objective:
    """Negative log posterior over z = [mean], log variance, log lengthscales, [log noise]."""

    def __init__(self, points: NDArray, values: NDArray, settings: FitSettings) -> None:
        gpy = import_gpy()
        self.settings = settings
        self.dimension = points.shape[1]
        self.model = gpy.core.GP(
            points.copy(),
            values[:, None].copy(),
            getattr(gpy.kern, kernel_named(settings.kernel).gpy)(self.dimension, ARD=True),
            gpy.likelihoods.Gaussian(variance=1.0 if settings.noise is None else settings.noise),
            mean_function=gpy.mappings.Constant(self.dimension, 1) if MEANS[settings.mean] else None,
        )
        # Positivity is ensured by the logarithms here; GPy's own transformations would act a second time.
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            self.model.unconstrain()
        self.means = MEANS[settings.mean]
        free_noise = settings.noise is None
        bounds = [MEAN_BOUNDS] * self.means
        logs = [VARIANCE_BOUNDS] + [LENGTHSCALE_BOUNDS] * self.dimension + [NOISE_BOUNDS] * free_noise
        self.bounds = np.array([*bounds, *(np.log(pair) for pair in logs)])
        self.prior_mean, self.prior_deviation = lengthscale_prior(self.dimension)

    @property
    def lengthscales(self) -> slice:
        return slice(self.means + 1, self.means + 1 + self.dimension)

    def parameters(self, z: NDArray) -> NDArray:
        """GPy's own parameter vector: mean, variance, lengthscales, noise."""
        values = z.copy()
        values[self.means :] = np.exp(z[self.means :])
        return values if self.settings.noise is None else np.append(values, self.settings.noise)

    def __call__(self, z: NDArray) -> tuple[float, NDArray]:
        values = self.parameters(z)
        try:
            self.model[:] = values
        except np.linalg.LinAlgError:
            return 1e10, np.zeros_like(z)
        value = -self.model.log_likelihood()
        gradient = -np.array(self.model._log_likelihood_gradients()[: len(z)])
        gradient[self.means :] *= values[self.means : len(z)]
        if self.settings.priors:
            logs = z[self.lengthscales]
            # The density of the lengthscale itself, not of its logarithm: hence the second term.
            standard = (logs - self.prior_mean) / self.prior_deviation
            value += float(0.5 * standard @ standard + logs.sum())
            gradient[self.lengthscales] += standard / self.prior_deviation + 1.0
        return float(value), gradient

    def starts(self, rng: np.random.Generator) -> list[NDArray]:
        """One fixed start, and the best few of random ones."""
        fixed = np.zeros(len(self.bounds))
        fixed[self.lengthscales] = 0.5 * np.log(self.dimension)
        low, high = fixed - 1.5, fixed + 1.5
        low[: self.means], high[: self.means] = -1.0, 1.0
        if self.settings.noise is None:
            fixed[-1], low[-1], high[-1] = np.log(1e-2), np.log(1e-5), np.log(0.3)
        random = rng.uniform(low, high, (self.settings.screened, len(fixed)))
        order = np.argsort([self(z)[0] for z in random], kind="stable")
        return [fixed, *random[order[: self.settings.restarts]]]


def fit(points: NDArray, values: NDArray, settings: FitSettings, rng: np.random.Generator) -> Posterior:
    """Fit an exact Gaussian process by maximum marginal likelihood (with priors: maximum a posteriori).

    Parameters
    ----------
    points : ndarray (n, d)
        In the unit cube.
    values : ndarray (n,)
        Standardised, finite.
    settings : FitSettings
    rng : numpy.random.Generator
        Draws the random starts; numpy's global state is not touched.

    Raises
    ------
    ValueError
        A point or value that is not finite: GPy would return its start values without a word.
    """
    if not (np.isfinite(points).all() and np.isfinite(values).all()):
        raise ValueError("a Gaussian process was given a point or value that is not finite")
    objective = _Objective(points, values, settings)
    results = [
        minimize(
            objective,
            start,
            jac=True,
            method="L-BFGS-B",
            bounds=objective.bounds,
            options={"maxiter": settings.iterations, "ftol": 1e-7, "gtol": 1e-3},
        )
        for start in objective.starts(rng)
    ]
    best = min(results, key=lambda result: result.fun)
    objective(best.x)
    found = objective.parameters(best.x)
    hyper = Hyperparameters(
        mean=float(found[0]) if objective.means else 0.0,
        variance=float(found[objective.means]),
        noise=float(found[-1]),
        lengthscales=found[objective.lengthscales],
    )
    posterior = objective.model.posterior
    inverse_factor = solve_triangular(posterior.woodbury_chol, np.eye(len(points)), lower=True)
    alpha = np.array(posterior.woodbury_vector[:, 0])
    return Posterior(settings.kernel, hyper, points.copy(), alpha, inverse_factor)
