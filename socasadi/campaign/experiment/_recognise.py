"""Which controller an experiment was flown with."""

from collections.abc import Mapping
from math import inf
from typing import TYPE_CHECKING

import numpy as np

from ...mpc import DesignError
from ._episode import Episode

if TYPE_CHECKING:
    from .._study import Study

_ALIKE = 0.02
"""Share of the input bound within which a record is its controller's, whatever digits and single precision leave."""
_CLOSER = 0.2
"""Another trial's controller is recognised when it is at most so many times as far from the record as its own."""


def distance_from(theta: np.ndarray, episode: Episode, study: "Study") -> float:
    """How far an episode's inputs are from those of theta's controller, given the same measurements.

    Returns
    -------
    float
        Root mean square over inputs and samples, as a share of the input bound; infinite where theta gives no
        controller.
    """
    mpc = study.mpc
    try:
        controller = mpc.controller(theta)
    except DesignError:
        return inf
    controller.reset(episode.held)
    preview, answers = np.arange(1, mpc.reference_rows + 1), []
    for t, y in enumerate(episode.output[:-1]):
        known = episode.disturbance[t] if mpc.measured_disturbances else None
        answers.append(controller.step(y, study.task.reference((t + preview) * mpc.sample_time), known))
    return float(np.sqrt(np.mean(((np.array(answers) - episode.tension) / mpc.input_scale) ** 2)))


def recognise(
    number: int, episode: Episode, thetas: Mapping[int, np.ndarray], study: "Study"
) -> tuple[float, int | None]:
    """Whether an episode can be that of trial ``number``.

    Returns
    -------
    (share, other)
        :func:`distance_from` its own theta; and the number of the trial among ``thetas`` whose controller gave these
        inputs instead, None where there is none.
    """
    own = distance_from(thetas[number], episode, study)
    if own <= _ALIKE:
        return own, None
    others = {other: distance_from(theta, episode, study) for other, theta in thetas.items() if other != number}
    closest = min(others, key=lambda other: others[other], default=None)
    return own, closest if closest is not None and others[closest] < _CLOSER * own else None
