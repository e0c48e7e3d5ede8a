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
        Root mean square over the samples after 5 s of the distance of the true outputs from the reference, m.
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
        error = episode.output[1:] - episode.reference[1:]
        Q = weight_matrix(self.Q, error.shape[1], "Q of the cost")
        R = weight_matrix(self.R, episode.tension.shape[1], "R of the cost")
        scaled = episode.tension / input_scale
        changes = np.diff(scaled, axis=0, prepend=episode.held[None] / input_scale)
        weighed = {"rate": changes, "normalised": scaled, "literal": episode.tension}
        tracking = _quadratic(error, Q)
        effort = _quadratic(weighed[self.input_term], R)
        # A task that ends within 5 s has no settled part and is judged whole.
        settled = episode.time > 5.0 if episode.time[-1] > 5.0 else episode.time > 0
        distance = np.linalg.norm((episode.truth - episode.reference)[settled], axis=1)
        return Score(
            J=tracking + effort,
            tracking=tracking,
            effort=effort,
            literal=tracking + _quadratic(episode.tension, R),
            rmse=float(np.sqrt(np.mean(distance**2))),
        )


def _quadratic(rows: np.ndarray, weight: np.ndarray) -> float:
    return float(np.einsum("ti,ij,tj->", rows, weight, rows))
