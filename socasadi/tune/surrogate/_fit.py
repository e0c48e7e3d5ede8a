"""Fitting the Gaussian process of a cost: hyperparameters by maximum marginal likelihood."""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .._named import choose
from ._evidence import KernelMatrix, descend, import_gpy, kernel_bounds
from ._kernel import kernel_named
from ._posterior import Hyperparameters
from ._prior import balance_penalty, lengthscale_penalty, noise_penalty
from ._sample import slice_sample
from ._warp import BOUNDS as WARP_BOUNDS
from ._warp import PRIOR_DEVIATION, Warp

MEANS = {"constant": 1, "zero": 0}  # how many numbers of each are fitted

MEAN_BOUNDS = (-5.0, 5.0)
NOISE_BOUNDS = (1e-6, 1.0)


@dataclass(frozen=True)
class FitSettings:
    """What is fitted, and how.

    `noise` is None (fitted) or a fixed variance on the standardised scale; `additive` gives the kernel a sum of
    one-dimensional ones beside that of all coordinates; `priors` puts those of `_prior.py` on top of the likelihood,
    without them it is pure maximum likelihood; `bold` ones leave the lengthscales and the noise to the data, others
    hold `likely_noise` for it (median of its variance, deviation of the logarithm); `warp` fits a warping of the
    inputs, too; of `screened` random starts the best `restarts` are optimised, beside the fixed start.
    """

    kernel: str = "matern52"
    mean: str = "constant"
    additive: bool = False
    priors: bool = True
    noise: float | None = None
    warp: bool = False
    bold: bool = False
    likely_noise: tuple[float, float] = (1e-2, 3.0)
    screened: int = 60
    restarts: int = 4

    def __post_init__(self) -> None:
        kernel_named(self.kernel)
        choose("mean", MEANS, self.mean)
        number = isinstance(self.noise, float | int | np.number) and not isinstance(self.noise, bool)
        if self.noise is not None and not (number and np.isfinite(self.noise) and self.noise > 0):
            raise ValueError(
                f'noise is {self.noise!r}: give "fitted", or a positive variance of the standardised targets'
            )


class Loss:
    """Minus the log posterior density of z.

    z holds [mean], the logarithms of variance, lengthscales, [the sum's variance], [noise], [a, b of the warping].

    Parameters
    ----------
    points : ndarray (n, d)
        In the unit cube.
    targets : ndarray (n,)
        Standardised.
    known : ndarray (n,)
        Variance of each target's noise that is known beforehand; the fitted or fixed one comes on top.
    settings : FitSettings
    """

    def __init__(self, points: NDArray, targets: NDArray, known: NDArray, settings: FitSettings) -> None:
        gpy = import_gpy()
        self.points, self.targets, self.known, self.settings = points, targets, known, settings
        self.inference = gpy.inference.latent_function_inference.ExactGaussianInference()
        self.likelihood = gpy.likelihoods.Gaussian()
        d = points.shape[1]
        self.matrix = KernelMatrix(settings.kernel, points, settings.additive)
        means, free, warped = MEANS[settings.mean], settings.noise is None, 2 * d * settings.warp
        self.mean = slice(0, means)
        self.kernel = slice(means, means + 1 + d + settings.additive)
        self.lengthscales = slice(means + 1, means + 1 + d)
        self.sum = slice(self.lengthscales.stop, self.kernel.stop)
        self.noise = slice(self.kernel.stop, self.kernel.stop + free)
        self.warp = slice(self.noise.stop, self.noise.stop + warped)
        blocks = [MEAN_BOUNDS] * means, [np.log(NOISE_BOUNDS)] * free, [WARP_BOUNDS] * warped
        before, *after = (np.reshape(block, (-1, 2)) for block in blocks)
        self.bounds = np.vstack([before, kernel_bounds(d, settings.additive), *after])

    def __call__(self, z: NDArray) -> tuple[float, NDArray]:
        hyper, matrix = self.hyperparameters(z), self.matrix
        if hyper.warp is not None:
            matrix = KernelMatrix(self.settings.kernel, hyper.warp(self.points), self.settings.additive)
        try:
            _, evidence, by = self.inference.inference(
                None,
                self.points,
                self.likelihood,
                (self.targets - hyper.mean)[:, None],
                K=matrix(z[self.kernel]),
                variance=hyper.noise + self.known,
            )
        except np.linalg.LinAlgError:
            return 1e10, np.zeros_like(z)
        gradient = np.zeros_like(z)
        by_K = by["dL_dK"]
        gradient[self.mean] = -by["dL_dm"].sum()
        gradient[self.kernel] = -matrix.gradient(by_K)
        gradient[self.noise] = -np.trace(by_K) * hyper.noise
        value = -float(np.squeeze(evidence))
        if hyper.warp is not None:
            by_points = matrix.gradient_of_points(by_K)
            gradient[self.warp] = -np.concatenate(
                [(by_points * by).sum(axis=0) for by in hyper.warp.by_logs(self.points)]
            )
            value += 0.5 * float(z[self.warp] @ z[self.warp]) / PRIOR_DEVIATION**2
            gradient[self.warp] += z[self.warp] / PRIOR_DEVIATION**2
        if self.settings.priors:
            penalty, slopes = self._penalty(z)
            value += penalty
            gradient += slopes
        return value, gradient

    def _penalty(self, z: NDArray) -> tuple[float, NDArray]:
        """Minus the logarithm of the priors' density, with its gradient."""
        value, gradient = 0.0, np.zeros_like(z)
        priors: list[tuple[slice, Callable[[NDArray], tuple[float, NDArray]]]] = [
            (self.lengthscales, functools.partial(lengthscale_penalty, akin=not self.settings.bold))
        ]
        if self.settings.noise is None and not self.settings.bold:
            median, deviation = self.settings.likely_noise
            priors.append((self.noise, functools.partial(noise_penalty, median=median, deviation=deviation)))
        if self.settings.additive:
            priors.append((slice(self.kernel.start, self.kernel.stop), balance_penalty))
        for part, prior in priors:
            penalty, slope = prior(z[part])
            value += penalty
            gradient[part] += slope
        return value, gradient

    def hyperparameters(self, z: NDArray) -> Hyperparameters:
        """What z stands for."""
        fixed = self.settings.noise
        return Hyperparameters(
            kernel=self.settings.kernel,
            mean=float(z[0]) if self.mean.stop else 0.0,
            variance=float(np.exp(z[self.kernel][0])),
            noise=float(np.exp(z[self.noise][0])) if fixed is None else fixed,
            lengthscales=np.exp(z[self.lengthscales]),
            additive=float(np.exp(z[self.sum][0])) if self.settings.additive else 0.0,
            warp=Warp(*np.exp(z[self.warp]).reshape(2, -1)) if self.settings.warp else None,
        )

    def position(self, hyper: Hyperparameters) -> NDArray:
        """The z that stands for them."""
        z = np.zeros(len(self.bounds))
        z[self.mean] = hyper.mean
        z[self.kernel.start] = np.log(hyper.variance)
        z[self.lengthscales] = np.log(hyper.lengthscales)
        z[self.sum] = np.log(hyper.additive or hyper.variance)
        z[self.noise] = np.log(hyper.noise)
        if hyper.warp is not None:
            z[self.warp] = np.log([*hyper.warp.a, *hyper.warp.b])
        return z

    @property
    def start(self) -> NDArray:
        """The start that all fits have."""
        z = np.zeros(len(self.bounds))
        z[[self.kernel.start, *range(len(z))[self.sum]]] = -np.log(1 + self.settings.additive)
        z[self.lengthscales] = 0.5 * np.log(self.points.shape[1])
        z[self.noise] = np.log(1e-2)
        return z

    def starts(self, rng: np.random.Generator) -> list[NDArray]:
        """That one, and the best few of random ones."""
        low, high = self.start - 1.5, self.start + 1.5
        low[self.mean], high[self.mean] = -1.0, 1.0
        low[self.noise], high[self.noise] = np.log(1e-5), np.log(0.3)
        low[self.warp], high[self.warp] = -0.3, 0.3
        random = rng.uniform(low, high, (self.settings.screened, len(low)))
        order = np.argsort([self(z)[0] for z in random], kind="stable")
        return [self.start, *random[order[: self.settings.restarts]]]


def fit(
    points: NDArray,
    targets: NDArray,
    settings: FitSettings,
    rng: np.random.Generator,
    known: NDArray | None = None,
    start: Hyperparameters | None = None,
    least_noise: float = 0.0,
) -> Hyperparameters:
    """Return the hyperparameters of maximum marginal likelihood (with priors: maximum a posteriori).

    Parameters
    ----------
    points : ndarray (n, d)
        In the unit cube.
    targets : ndarray (n,)
        Standardised, finite.
    settings : FitSettings
    rng : numpy.random.Generator
        Draws the random starts; numpy's global state is not touched.
    known : ndarray (n,), optional
        Variance of each target's own noise, where that is known; the common noise comes on top.
    start : Hyperparameters, optional
        Of an earlier fit: the only start.
    least_noise : float
        Lower bound of a fitted noise variance.

    Raises
    ------
    ValueError
        A point or value that is not finite: GPy would return its start values without a word.
    """
    loss = _loss(points, targets, settings, known)
    loss.bounds[loss.noise, 0] = np.log(np.clip(least_noise, *NOISE_BOUNDS))
    starts = loss.starts(rng) if start is None else [loss.position(start)]
    return loss.hyperparameters(descend(loss, starts, loss.bounds))


def draw(
    points: NDArray,
    targets: NDArray,
    settings: FitSettings,
    rng: np.random.Generator,
    known: NDArray,
    start: Hyperparameters,
    count: int,
    least_noise: float = 0.0,
) -> list[Hyperparameters]:
    """Return `count` hyperparameters drawn from their distribution given the data, beginning at `start`, the fitted.

    Parameters as of `fit`.
    """
    loss = _loss(points, targets, settings, known)
    loss.bounds[loss.noise, 0] = np.log(np.clip(least_noise, *NOISE_BOUNDS))

    def log_density(z: NDArray) -> float:
        # Priors are densities of the lengthscales themselves, the space that is sampled is that of their logarithms.
        return (float(z[loss.lengthscales].sum()) if settings.priors else 0.0) - loss(z)[0]

    drawn = slice_sample(log_density, loss.position(start), loss.bounds, loss.lengthscales, count, rng)
    return [loss.hyperparameters(z) for z in drawn]


def evidence(points: NDArray, targets: NDArray, settings: FitSettings, known: NDArray | None = None) -> float:
    """Return the logarithm of the greatest posterior density that one descent from the fixed start finds.

    Parameters and errors as of `fit`.
    """
    loss = _loss(points, targets, settings, known)
    return -loss(descend(loss, [loss.start], loss.bounds))[0]


def _loss(points: NDArray, targets: NDArray, settings: FitSettings, known: NDArray | None) -> Loss:
    if not (np.isfinite(points).all() and np.isfinite(targets).all()):
        raise ValueError("a Gaussian process was given a point or value that is not finite")
    return Loss(points, targets, np.zeros(len(points)) if known is None else known, settings)
