"""What the journal holds, as objects."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from ..experiment import Episode, Score

Outcome = Literal["done", "failed", "cut"]


@dataclass(frozen=True, eq=False)
class Asked:
    """A trial that was asked, with what it takes to fly it.

    Attributes
    ----------
    number
        From 1, in the order of asking.
    phase
        ``"seed"`` or ``"search"``.
    theta
        (size,).
    give_up
        J above which its episode may be cut; None for never.
    asked
        Number of the event: asks, tells and takings back are counted together, from 1, as they happened.
    started
        UTC, ISO 8601.
    by_hand
        Whether it was asked for somebody who flies it and tells it; a run flies none of these.
    seconds
        Wall time of the search: ``fit`` and ``acquisition``.
    """

    number: int
    phase: str
    theta: np.ndarray
    give_up: float | None
    asked: int
    started: str
    by_hand: bool
    seconds: dict[str, float]


@dataclass(frozen=True, eq=False)
class Trial(Asked):
    """A trial with its outcome: what was asked, as in :class:`Asked`, and what came of it.

    Attributes
    ----------
    told
        Number of the event.
    outcome
        ``"done"``; ``"failed"``; ``"cut"``, when its episode was broken off as hopeless.
    J
        Cost of a trial that is done, None otherwise.
    at_least
        What J of a cut trial would have been at least, None otherwise.
    score
        J with its parts; None unless done, and where J was measured elsewhere.
    measured
        Values of the study's limits, by name.
    failure
        Why it failed or was cut, None when it is done.
    plant_seconds, saved_seconds
        s of the robot's time that were flown, and those that were not because it was cut; None without a record.
    seconds
        Wall time of the whole ``trial``, and of its parts: ``fit`` and ``acquisition`` of the search, ``design`` of the
        controller, ``plant`` and ``controller`` during the episode.
    """

    told: int
    outcome: Outcome
    J: float | None = None
    at_least: float | None = None
    score: Score | None = None
    measured: dict[str, float] | None = None
    failure: str | None = None
    plant_seconds: float | None = None
    saved_seconds: float | None = None


@dataclass(frozen=True, eq=False)
class Flight:
    """An experiment beside the search: a probing record, or a check of a controller under fresh noise."""

    name: str
    theta: np.ndarray | None
    score: Score | None
    episode: Episode
