"""Output transforms: what the Gaussian process models instead of the cost itself."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import boxcox, inv_boxcox, ndtri

from .._named import choose

# A power below -1 would press all bad costs onto one number, one above 1 the good ones.
POWERS = (-1.0, 1.0)


@dataclass(frozen=True)
class Scale:
    """An increasing map from costs to targets, and back; on arrays of any shape.

    `log_slope` is the logarithm of the derivative of `forward`.
    """

    forward: Callable[[NDArray], NDArray]
    inverse: Callable[[NDArray], NDArray]
    log_slope: Callable[[NDArray], NDArray]


Fit = Callable[[NDArray], Scale]
"""Finds a scale for the costs seen; a pure function of all of them at once."""


@dataclass(frozen=True)
class Transform:
    """One way to find a scale, or several, of which the one of greatest evidence is taken.

    `of_positive` are ways that only positive costs can go; where there is no other, J > 0 is needed.
    """

    fits: tuple[Fit, ...] = ()
    of_positive: tuple[Fit, ...] = ()

    @property
    def positive(self) -> bool:
        """Whether it needs J > 0."""
        return not self.fits

    def ways(self, costs: NDArray) -> tuple[Fit, ...]:
        """Those that the costs can go."""
        return self.fits + (self.of_positive if (costs > 0).all() else ())

    def check(self, cost: float) -> None:
        """Raise ValueError for a cost that the transform cannot take."""
        if self.positive and cost <= 0:
            raise ValueError(
                f'the cost is {cost} and its logarithm or power is modelled: use transform="power" for J <= 0'
            )


def _same(costs: NDArray) -> Scale:
    return Scale(np.array, np.array, np.zeros_like)


def _box_cox(power: float | None) -> Fit:
    """(J^p - 1)/p, of costs that are positive (Box and Cox 1964): of that power, or of the most normal one."""

    def fit(costs: NDArray) -> Scale:
        unit = float(np.exp(np.log(costs).mean()))
        p = _most_normal("boxcox", costs / unit) if power is None else power
        ends = np.sort(boxcox(np.array([1e-100, 1e100]), p))

        def inverse(targets: NDArray) -> NDArray:
            # Of a negative power no cost reaches beyond -1/p.
            return unit * np.clip(inv_boxcox(np.clip(targets, *ends), p), 1e-100, 1e100)

        def log_slope(costs: NDArray) -> NDArray:
            return (p - 1) * np.log(np.asarray(costs) / unit) - np.log(unit)

        return Scale(lambda costs: boxcox(np.asarray(costs) / unit, p), inverse, log_slope)

    return fit


def _yeo_johnson(power: float | None) -> Fit:
    """The power transform for numbers of either sign (Yeo and Johnson 2000), about the median, in quartile ranges.

    Of that power, or of the one that makes the costs most normal.
    """

    def fit(costs: NDArray) -> Scale:
        centre = float(np.median(costs))
        low, high = np.quantile(costs, (0.25, 0.75))
        unit = float(high - low)
        if unit <= 1e-9 * np.ptp(costs):
            unit = float(np.ptp(costs)) or 1.0
        p = _most_normal("yeojohnson", (costs - centre) / unit) if power is None else power

        def forward(costs: NDArray) -> NDArray:
            x = (np.asarray(costs, dtype=float) - centre) / unit
            return np.where(x >= 0, boxcox(1 + np.maximum(x, 0), p), -boxcox(1 + np.maximum(-x, 0), 2 - p))

        ends = forward(centre + unit * np.array([-1e50, 1e50]))

        def inverse(targets: NDArray) -> NDArray:
            z = np.clip(targets, *ends)
            with np.errstate(all="ignore"):
                x = np.where(z >= 0, inv_boxcox(np.maximum(z, 0), p) - 1, 1 - inv_boxcox(np.maximum(-z, 0), 2 - p))
            # Of a power of -1 no cost reaches beyond 1.
            return centre + unit * np.clip(x, -1e50, 1e50)

        def log_slope(costs: NDArray) -> NDArray:
            x = (np.asarray(costs, dtype=float) - centre) / unit
            return (p - 1) * np.sign(x) * np.log1p(np.abs(x)) - np.log(unit)

        return Scale(forward, inverse, log_slope)

    return fit


def _most_normal(family: str, costs: NDArray) -> float:
    from scipy import stats  # half of the time that importing the package would take

    if len(costs) < 3 or np.ptp(costs) < 1e-9 * max(1.0, float(np.abs(costs).max())):
        return 1.0
    with np.errstate(all="ignore"):
        try:
            power = float(np.squeeze(getattr(stats, f"{family}_normmax")(costs)))
        except (ValueError, RuntimeError):
            return 1.0
    return float(np.clip(power, *POWERS)) if np.isfinite(power) else 1.0


def _half_rank(base: Fit) -> Fit:
    """Above the median, no farther than ranks would put a cost on the scale of the better half.

    A closed-loop cost is flat near its best and falls off cliffs elsewhere. How bad a bad trial was tells little, and
    modelling it leaves a stationary process no resolution where trials are good. A tail that is heavier than a normal
    one of the better half's spread therefore keeps its order only, as in Vizier's half-rank warping (Song et al. 2024,
    arXiv 2408.11527); a lighter one stays as it is. The slope is that of the base: ranks say nothing of the base.
    """

    def fit(costs: NDArray) -> Scale:
        inner = base(costs)
        values = inner.forward(costs)
        median = float(np.median(values))
        good = values <= median
        spread = float(np.sqrt(np.mean((values[good] - median) ** 2)))
        if spread == 0:
            return inner
        bad, ordered = np.unique(values[~good]), np.sort(values)
        # Equals share the middle of their ranks.
        ranks = 0.5 * (np.searchsorted(ordered, bad, "left") + np.searchsorted(ordered, bad, "right"))
        ranked = ndtri(ranks / len(values))
        knots = np.concatenate([[median], bad])
        heights = np.concatenate([[median], np.minimum(bad, median + spread * ranked)])
        # Ties aside it increases; what is worse than all seen goes on with the last slope, which is above zero.
        heights = np.maximum.accumulate(heights + 1e-9 * spread * np.arange(len(heights)))
        slope = max(float((heights[-1] - median) / (knots[-1] - median)), 1e-6) if len(knots) > 1 else 1.0

        def forward(costs: NDArray) -> NDArray:
            z = inner.forward(np.asarray(costs, dtype=float))
            inside = np.where(z <= median, z, np.interp(z, knots, heights))
            return np.where(z > knots[-1], heights[-1] + slope * (z - knots[-1]), inside)

        def inverse(targets: NDArray) -> NDArray:
            z = np.asarray(targets, dtype=float)
            inside = np.where(z <= median, z, np.interp(z, heights, knots))
            return inner.inverse(np.where(z > heights[-1], knots[-1] + (z - heights[-1]) / slope, inside))

        return Scale(forward, inverse, inner.log_slope)

    return fit


_LINEAR = (_same,)
_ANY_SIGN = tuple(_yeo_johnson(power) for power in (0.5, 0.0, -0.5, -1.0))
_POSITIVE = tuple(_box_cox(power) for power in (0.5, 0.0, -0.5))

TRANSFORMS: dict[str, Transform] = {
    "power": Transform(_LINEAR + _ANY_SIGN, _POSITIVE),
    "power-half-rank": Transform(
        tuple(_half_rank(fit) for fit in _LINEAR + _ANY_SIGN), tuple(_half_rank(fit) for fit in _POSITIVE)
    ),
    "half-rank": Transform((_half_rank(_same),)),
    "log": Transform(of_positive=(_box_cox(0.0),)),
    "log-half-rank": Transform(of_positive=(_half_rank(_box_cox(0.0)),)),
    "box-cox": Transform(of_positive=(_box_cox(None),)),
    "yeo-johnson": Transform((_yeo_johnson(None),)),
    "none": Transform(_LINEAR),
}


def transform_named(name: str) -> Transform:
    """Return the transform of that name; ValueError lists the known ones."""
    return choose("transform", TRANSFORMS, name)
