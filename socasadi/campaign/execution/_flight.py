"""One trial, flown here: the controller of a theta against the robot, within a limit of time."""

import signal
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from types import FrameType
from typing import TYPE_CHECKING, NoReturn

from numpy.typing import ArrayLike

from ...mpc import DesignError
from ..experiment import Episode, Pilot, fly
from ._stream import Stream, drawn_seed

if TYPE_CHECKING:
    from .._study import Study

# An episode looks at the clock once a sample; only a sample that has not ended so much later is broken off.
_MARGIN = 1.0
_LONGEST = 1e8  # s that a timer takes


@dataclass(frozen=True, eq=False)
class Flown:
    """What a trial gave: its ``episode``, or why there is none (``failed``), and the wall time of its parts, s."""

    episode: Episode | None
    failed: str | None
    seconds: dict[str, float]


def fly_trial(study: "Study", number: int, theta: ArrayLike, give_up: float | None) -> Flown:
    """Build the controller of ``theta`` and fly it; its noise is that of trial ``number``, wherever and whenever."""
    begin = time.perf_counter()
    try:
        controller = study.mpc.controller(theta)
    except DesignError as error:
        return Flown(None, f"DesignError: {error}", {"trial": time.perf_counter() - begin})
    seconds = {"design": time.perf_counter() - begin}
    try:
        episode = fly_once(study, controller, (Stream.TRIAL, number), give_up=give_up)
    except TimeoutError as error:  # the alarm rang when the episode was over but not yet put together
        return Flown(None, f"TimeoutError: {error}", seconds | {"trial": time.perf_counter() - begin})
    return Flown(episode, None, seconds | episode.seconds | {"trial": time.perf_counter() - begin})


def fly_once(study: "Study", controller: Pilot, noise: tuple[Stream, int], give_up: float | None = None) -> Episode:
    """One episode of the study; its noise is that of the experiment of this number in a stream."""
    limits = {"time_limit": study.time_limit, "give_up": give_up, "cost": study.cost}
    with _alarm(study.time_limit):
        return fly(study.plant, controller, study.task, seed=drawn_seed(study.seed, *noise), **limits)


@contextmanager
def _alarm(limit: float) -> Iterator[None]:
    """Break off what blocks for longer than ``limit`` s, such as a robot that does not answer, by a TimeoutError.

    It rings again every second, lest a library drops it. Only the main thread hears signals, and code in C that never
    returns hears none: processes that fly trials are ended from outside then.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def ring(number: int, frame: FrameType | None) -> NoReturn:
        raise TimeoutError(f"took longer than its limit of {limit:g} s, and was broken off")

    before = signal.signal(signal.SIGALRM, ring)
    signal.setitimer(signal.ITIMER_REAL, min(limit + _MARGIN, _LONGEST), 1.0)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
