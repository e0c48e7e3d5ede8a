from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ...mpc import InputTerm, Weight, check_input_term, weight_matrix
from ._episode import Episode


@dataclass(frozen=True)
class Score:
    """What an episode is worth.

    Attributes
    ----------
    J
        The cost: ``tracking`` plus ``effort``.
    tracking, effort
        Its two sums.
    literal
        J as the paper writes it, with u in newtons.
    rmse
        Root mean square over the samples after 5 s of the distance of the true outputs from the reference, m; of the
        measured ones, with the sensor's noise in it, where the plant does not know the true ones.
    """

    J: float
    tracking: float
    effort: float
    literal: float
    rmse: float


@dataclass(frozen=True)
class Cost:
    r"""Cost of an episode, which belongs to the study: the weights inside the MPC never enter it.

    .. math:: J = \sum_{t=1}^{N} (y_t - r_t)' Q (y_t - r_t) + \sum_{t=0}^{N-1} \rho_R(u_t)

    on the measured outputs (Pal, He and Wei, arXiv 2210.08780, with the input term by choice).

    Parameters
    ----------
    Q
        1/m2: a number, p numbers or a (p, p) matrix.
    R
        A number, m numbers or an (m, m) matrix.
    input_term
        What R weighs: ``"rate"``, the change of u/u_max from sample to sample; ``"normalised"``, u/u_max;
        ``"literal"``, u in newtons.
    """

    Q: Weight = 1e3
    R: Weight = 1.0
    input_term: InputTerm = "rate"

    def __post_init__(self) -> None:
        check_input_term(self.input_term)

    def score(self, episode: Episode, input_scale: np.ndarray) -> Score:
        """Score of a finished episode; ``input_scale`` (m,) N is u_max."""
        meter = self.meter(episode.held, episode.output.shape[1], input_scale)
        for row in _samples(episode):
            meter.add(*row)
        # A task that ends within 5 s has no settled part and is judged whole.
        settled = episode.time > 5.0 if episode.time[-1] > 5.0 else episode.time > 0
        distance = np.linalg.norm((episode.truth - episode.reference)[settled], axis=1)
        return Score(
            J=meter.J,
            tracking=meter.tracking,
            effort=meter.effort,
            literal=meter.literal,
            rmse=float(np.sqrt(np.mean(distance**2))),
        )

    def running(self, episode: Episode, input_scale: np.ndarray) -> np.ndarray:
        """The cost that each sample of an episode, whole or not, has proven (T,): it never falls, and ends at J."""
        meter = self.meter(episode.held, episode.output.shape[1], input_scale)
        return np.array([meter.add(*row) for row in _samples(episode)])

    def meter(self, held: np.ndarray, outputs: int, input_scale: np.ndarray) -> "Meter":
        """A meter at zero, for an episode that starts under the tensions ``held`` (m,) N."""
        return Meter(self, held, outputs, input_scale)


class Meter:
    """Adds up the cost of an episode, sample by sample.

    Since no term is negative, what it shows is a lower bound of the whole episode's J at any time, in exact arithmetic
    and in this one: it is J once all samples are in.
    """

    def __init__(self, cost: Cost, held: np.ndarray, outputs: int, input_scale: np.ndarray) -> None:
        self._Q = weight_matrix(cost.Q, outputs, "Q of the cost")
        self._R = weight_matrix(cost.R, len(held), "R of the cost")
        self._term, self._scale, self._before = cost.input_term, input_scale, held / input_scale
        self.tracking = self.effort = self.literal = 0.0

    @property
    def J(self) -> float:
        """Cost so far."""
        return self.tracking + self.effort

    def add(self, output: np.ndarray, reference: np.ndarray, tension: np.ndarray) -> float:
        """Count a sample: what was measured and wanted at its end, and the tensions held during it; J so far."""
        scaled = tension / self._scale
        weighed = {"rate": scaled - self._before, "normalised": scaled, "literal": tension}[self._term]
        self._before = scaled
        with np.errstate(invalid="ignore", over="ignore"):  # what is not finite is for the caller to judge
            error = _quadratic(output - reference, self._Q)
            self.tracking += error
            self.effort += _quadratic(weighed, self._R)
            self.literal += error + _quadratic(tension, self._R)
        return self.J


def _samples(episode: Episode) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    return zip(episode.output[1:], episode.reference[1:], episode.tension, strict=True)


def _quadratic(row: np.ndarray, weight: np.ndarray) -> float:
    # A semidefinite weight may give rounding below zero.
    return max(float(row.dot(weight).dot(row)), 0.0)
