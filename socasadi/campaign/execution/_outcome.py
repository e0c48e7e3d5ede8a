"""What came of a trial: judged from its record, told to a search, compared with others."""

import math
from collections.abc import Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from ...tune import Search
from ..experiment import Episode, measure_limits
from ..store import Flight, Trial

if TYPE_CHECKING:
    from .._study import Study


def judged(study: "Study", episode: Episode) -> dict[str, Any]:
    """What the record of an episode makes of its trial: fields of a :class:`Trial`."""
    flown = len(episode.tension) * episode.sample_time
    about: dict[str, Any] = {"plant_seconds": flown, "saved_seconds": 0.0}
    if episode.failure is not None:
        return about | {"outcome": "failed", "failure": episode.failure}
    if episode.cut is not None:
        whole = study.task.samples(episode.sample_time) * episode.sample_time
        about |= {"saved_seconds": whole - flown, "failure": f"J is above {episode.cut:.4g} after {flown:g} s"}
        return about | {"outcome": "cut", "at_least": episode.cut}
    try:
        score = study.cost.score(episode, study.mpc.input_scale)
        measured = measure_limits(study.limits, episode, study.mpc)
    except Exception as error:  # a limit may be a function of the user's
        return about | {"outcome": "failed", "failure": f"{type(error).__name__}: {error}"}
    for name, value in {**asdict(score), **measured}.items():
        if not math.isfinite(value):
            return about | {"outcome": "failed", "failure": f"{name} of the episode is not finite: {value}"}
    return about | {"outcome": "done", "J": score.J, "score": score, "measured": measured or None}


def keeps_limits(trial: Trial, study: "Study") -> bool:
    """Whether a trial is done and kept all limits of ``study``."""
    return trial.J is not None and all((trial.measured or {})[limit.name] <= limit.limit for limit in study.limits)


def flown_cost(flight: Flight, study: "Study") -> float:
    """J of a flight beside the search; infinity when it failed or broke a limit of ``study``."""
    if flight.score is None:
        return math.inf
    measured = measure_limits(study.limits, flight.episode, study.mpc)
    return flight.score.J if all(measured[limit.name] <= limit.limit for limit in study.limits) else math.inf


def broken_limits(trial: Trial, study: "Study") -> list[str]:
    """What a trial that is done measured beyond the limits of ``study``, in words."""
    measured = trial.measured or {}
    return [
        f"{limit.name} {measured[limit.name]:.3g} above {limit.limit:g} {limit.unit}".rstrip()
        for limit in study.limits
        if trial.J is not None and measured[limit.name] > limit.limit
    ]


def best_trial(trials: Sequence[Trial], study: "Study") -> Trial | None:
    """The trial of least J among those that kept all limits, the first of equals; None without one."""
    kept = (trial for trial in trials if keeps_limits(trial, study))
    return min(kept, key=lambda trial: trial.J or 0.0, default=None)


def replayed(search: Search, trials: Sequence[Trial]) -> Search:
    """``search`` after it was told ``trials``, which stand in the order of telling."""
    for trial in trials:
        tell_search(search, trial)
    return search


def tell_search(search: Search, trial: Trial) -> None:
    """Tell ``search`` what the journal holds of a trial."""
    match trial.outcome:
        case "done":
            search.tell(trial.theta, trial.J, measured=trial.measured)
        case "cut":
            search.tell(trial.theta, at_least=trial.at_least)
        case "failed":
            search.tell(trial.theta, failed=True)
