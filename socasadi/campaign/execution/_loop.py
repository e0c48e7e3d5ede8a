"""Ask, fly, tell: here one after another, or elsewhere side by side."""

import time
from collections import Counter
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, Executor, Future, wait
from pathlib import Path
from typing import TYPE_CHECKING

from ...plant import ExternalPlant
from ..experiment import check_interrupt, interruptible
from ..store import Asked, RunError, Trial
from ._campaign import Campaign, check_folder
from ._flight import Flown, fly_trial
from ._order import check_answer, check_not_ordered, fly_order, read_answer, script_of, write_order
from ._outcome import broken_limits
from ._processes import Processes
from ._progress import Clock, Progress

if TYPE_CHECKING:
    from .._study import Study

# s beyond its limit of time that a trial elsewhere may take: for the way, and for making the study there.
GRACE = 60.0
_LOSSES = 3
_LONGEST = 3600.0  # s to wait without a look at the clock


def check_run(study: "Study", folder: Path, *, resume: bool) -> None:
    """Refuse a robot that cannot be flown from here and a folder that holds something else; nothing is written.

    Raises
    ------
    ExternalPlantError, RunError, JournalError
        As :meth:`Study.run`.
    """
    if isinstance(study.plant, ExternalPlant):
        study.plant.prepare()
    check_folder(study, folder, resume)


def run_campaign(
    study: "Study",
    folder: Path,
    *,
    resume: bool,
    progress: Callable[[Progress], None] | None,
    jobs: int | None,
    executor: Executor | None,
    script: Path | None,
) -> None:
    """Fly all trials of ``study`` that nobody flies by hand; see :meth:`Study.run`."""
    check_not_ordered()
    if isinstance(study.plant, ExternalPlant):
        study.plant.prepare()  # refuses, before a folder is made
    if jobs is None:
        jobs = 1 if executor is None else getattr(executor, "jobs", None)
    if not isinstance(jobs, int) or jobs < 1:
        raise ValueError(f"jobs is the number of trials at once, at least 1, not {jobs!r}")
    away = executor is not None or jobs > 1
    made_by = script_of(study, script) if away else None
    with interruptible(), Campaign(study, folder, resume) as campaign:
        if prepare := getattr(study.plant, "prepare", None):
            prepare()
        report = _Reporter(campaign, progress)
        if not away:
            _fly_here(campaign, report)
        elif executor is not None:
            _Away(campaign, executor, jobs, made_by, report).fly()
        else:
            with Processes(jobs) as processes:
                _Away(campaign, processes, jobs, made_by, report).fly()


class _Reporter:
    """Tells the campaign what a trial gave, and the user where the run stands."""

    def __init__(self, campaign: Campaign, progress: Callable[[Progress], None] | None) -> None:
        self._campaign, self._progress, self._clock = campaign, progress, Clock()

    def __call__(self, number: int, flown: Flown) -> None:
        campaign = self._campaign
        trial: Trial = campaign.tell(number, episode=flown.episode, failed=flown.failed, seconds=flown.seconds)
        if self._progress is not None:
            done, total = len(campaign.trials), campaign.study.trials
            elapsed, remaining = self._clock.tick(total - done)
            broken = tuple(broken_limits(trial, campaign.study))
            self._progress(Progress(trial, campaign.best, done, total, elapsed, remaining, broken))


def _to_fly(campaign: Campaign) -> Iterator[Asked]:
    """Trials that were asked by a run that was stopped, then new ones."""
    yield from (asked for asked in campaign.pending if not asked.by_hand)
    while len(campaign.trials) + len(campaign.pending) < campaign.study.trials:
        asked = campaign.ask(by_hand=False)
        check_interrupt()
        yield asked


def _fly_here(campaign: Campaign, report: _Reporter) -> None:
    for asked in _to_fly(campaign):
        report(asked.number, fly_trial(campaign.study, asked.number, asked.theta, asked.give_up))


class _Away:
    """Keeps an executor busy, so that a slow trial holds up nobody.

    A trial whose worker dies is flown again, the same in every way; one that does not come back in time has failed.
    """

    def __init__(
        self, campaign: Campaign, executor: Executor, jobs: int, script: str | None, report: _Reporter
    ) -> None:
        self._campaign, self._executor, self._jobs, self._report = campaign, executor, jobs, report
        self._script, self._losses = script, Counter()
        self._out: dict[Future, tuple[Asked, float]] = {}

    def fly(self) -> None:
        """Fly all that is to be flown."""
        self._check_workers()
        to_fly = _to_fly(self._campaign)
        try:
            while True:
                while len(self._out) < self._jobs and (asked := next(to_fly, None)) is not None:
                    self._send(asked)
                if not self._out:
                    return
                patience = min(deadline for _, deadline in self._out.values()) - time.monotonic()
                wait(self._out, min(max(0.0, patience), _LONGEST), FIRST_COMPLETED)
                check_interrupt()
                for future, (asked, deadline) in list(self._out.items()):
                    if future.done():
                        del self._out[future]
                        self._settle(asked, future)
                    elif time.monotonic() > deadline:
                        del self._out[future]
                        self._give_up(asked, future)
        finally:
            for future in self._out:
                future.cancel()

    def _check_workers(self) -> None:
        """RunError unless a worker can make the study: what is wrong with all of them is no trial's fault."""
        try:
            answer = self._executor.submit(fly_order, write_order(self._campaign.study, self._script, None)).result()
        except Exception as error:
            raise RunError(f"no worker answers: {type(error).__name__}: {error}") from error
        check_answer(answer)

    def _send(self, asked: Asked) -> None:
        try:
            future = self._executor.submit(fly_order, write_order(self._campaign.study, self._script, asked))
        except Exception as error:
            raise RunError(
                f"the executor takes no more trials ({type(error).__name__}: {error}); what was told is stored: resume"
            ) from error
        self._out[future] = asked, time.monotonic() + self._campaign.study.time_limit + GRACE

    def _settle(self, asked: Asked, future: Future) -> None:
        try:
            answer = future.result()
        except Exception as error:  # of the worker: what a trial raises is in its answer
            self._losses[asked.number] += 1
            if self._losses[asked.number] < _LOSSES:
                self._send(asked)
            else:
                reason = f"its worker was lost {_LOSSES} times, at last by {type(error).__name__}: {error}"
                self._report(asked.number, Flown(None, reason, {}))
            return
        self._report(asked.number, read_answer(answer))

    def _give_up(self, asked: Asked, future: Future) -> None:
        reason = f"TimeoutError: no answer {GRACE:g} s after its limit of {self._campaign.study.time_limit:g} s"
        if abandon := getattr(self._executor, "abandon", None):
            ended = abandon(future)
        elif future.cancel() and self._losses[asked.number] < _LOSSES - 1:
            # It waited in a queue, and nobody flew it.
            self._losses[asked.number] += 1
            self._send(asked)
            return
        else:
            ended = future.cancelled()
        # An executor that cannot end a worker is left with one that is busy for ever, as far as anybody knows.
        self._jobs -= not ended
        self._report(asked.number, Flown(None, reason, {}))
        if self._jobs == 0:
            raise RunError("every worker hangs in a trial; what was told is stored: resume with others")
