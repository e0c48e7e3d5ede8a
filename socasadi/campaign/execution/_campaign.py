import shlex
from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

from ...tune import Timings
from ..experiment import Episode
from ..store import (
    Asked,
    Journal,
    RunError,
    Trial,
    begun,
    compare_settings,
    journal_path,
    settings_path,
    write_settings,
)
from ._outcome import best_trial, judged, replayed, tell_search

if TYPE_CHECKING:
    from .._study import Study

_MAY_DIFFER = ("iterations", "verifications")


def check_folder(study: "Study", folder: Path, resume: bool) -> bool:
    """Whether ``folder`` holds a run, with which ``study`` may go on; nothing is written.

    Raises
    ------
    RunError, JournalError
        As :class:`Campaign`, but for a journal that another process is writing.
    """
    if folder.exists() and not folder.is_dir():
        raise RunError(f"{folder} is a file; name a folder for the run")
    if folder.exists() and any(folder.iterdir()) and not resume:
        raise RunError(f"{folder} exists already; resume it (--resume), or name another folder")
    started = begun(folder)
    if started and not settings_path(folder).exists():
        raise RunError(f"{folder} is no run folder: it has no study.json")
    if started:
        compare_settings(folder, study.settings, _MAY_DIFFER)
        with Journal(journal_path(folder)) as journal:
            _check_trials(study, folder, len(journal.trials()) + len(journal.pending()))
    return started


def _check_trials(study: "Study", folder: Path, trials: int) -> None:
    if trials > study.trials:
        raise RunError(f"{folder} holds {trials} trials already; ask for no fewer, not for {study.trials}")


class Campaign:
    """Asks and tells of a study, each in its journal before anything else happens.

    The search is rebuilt from the journal alone: it is told the trials in the order in which they were told, and it is
    shown those that are out. So the next point is the very one that there would have been without a stop.

    A context manager; while it is open, no other process can write the run folder.

    Parameters
    ----------
    study
        The question.
    folder
        The run folder, made unless it is there.
    resume
        Go on with the run that ``folder`` holds, if it holds one.

    Raises
    ------
    RunError
        ``folder`` is there (without ``resume``), or holds a run with other settings; the message names them.
        ``iterations`` and ``verifications`` may differ.
    JournalError
        Its journal is damaged, or another process is writing it.
    """

    def __init__(self, study: "Study", folder: str | Path, resume: bool = False) -> None:
        folder = Path(folder)
        started = check_folder(study, folder, resume)
        study.optimizer()  # refuses what cannot be searched, before anything is written
        folder.mkdir(parents=True, exist_ok=True)
        # The journal is made before the settings are written: a folder with settings and no journal has lost it.
        self._open(study, folder, create=not started)
        try:
            if started:
                compare_settings(folder, study.settings, _MAY_DIFFER)
            elif self.trials or self.pending:
                raise RunError(f"{folder} holds trials, but no study.json that says of what: restore it from a copy")
            _check_trials(study, folder, len(self.trials) + len(self.pending))
            write_settings(folder, study.settings)
        except BaseException:
            self.close()
            raise

    @classmethod
    def open(cls, folder: str | Path) -> "Campaign":
        """The campaign in ``folder``, without its study script: it can ask and be told.

        Raises
        ------
        RunError
            There is no run in it, or only its study script can make a part of the study other than the robot.
        JournalError
            Its journal is damaged, or another process is writing it.
        """
        from .._result import Result

        campaign = cls.__new__(cls)
        campaign._open(Result.open(folder).study, Path(folder), create=False)
        return campaign

    def _open(self, study: "Study", folder: Path, *, create: bool) -> None:
        self.study, self.folder = study, folder
        self._journal = Journal(journal_path(folder), writer=True, create=create)
        try:
            self._trials, pending = self._journal.trials(), self._journal.pending()
            self._pending = {asked.number: asked for asked in pending}
            self._taken_back = len(self._journal.taken_back())
            self._search = replayed(study.optimizer(), self._trials)
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        """Let others write the run folder."""
        self._journal.close()

    def __enter__(self) -> "Campaign":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def trials(self) -> Sequence[Trial]:
        """All trials that were told, in the order of telling."""
        return tuple(self._trials)

    @property
    def pending(self) -> Sequence[Asked]:
        """All trials that were asked and not told, in the order of asking."""
        return tuple(self._pending.values())

    @property
    def complete(self) -> bool:
        """Whether all trials of the study were told."""
        return len(self._trials) >= self.study.trials

    @property
    def best(self) -> Trial | None:
        """The trial of least J among those that kept all limits; None without one."""
        return best_trial(self._trials, self.study)

    def ask(self, *, by_hand: bool = True) -> Asked:
        """The next trial, stored as asked; the search reckons with those that are out.

        Parameters
        ----------
        by_hand
            Whether the caller sees to its flight and tells it: then no run will fly it.

        Raises
        ------
        RunError
            All trials of the study were asked.
        """
        number, events = len(self._trials) + len(self._pending) + 1, self._events()
        if number > self.study.trials:
            out = f", {len(self._pending)} of them are out" if self._pending else ""
            raise RunError(f"all {self.study.trials} trials of {self.folder} were asked{out}; ask for more iterations")
        started = datetime.now(UTC).isoformat(timespec="seconds")
        theta = self._search.ask(pending=[asked.theta for asked in self.pending])
        best, share = self.best, self.study.give_up if self.study.search != "paper" else None
        asked = Asked(
            number=number,
            phase="seed" if number <= self.study.seed_points else "search",
            theta=theta,
            give_up=None if best is None or best.J is None or share is None else share * best.J,
            asked=events + 1,
            started=started,
            by_hand=by_hand,
            seconds=asdict(self._search.timings),
        )
        self._journal.add_asked(asked)
        self._pending[number] = asked
        return asked

    def tell(
        self,
        number: int,
        *,
        episode: Episode | None = None,
        cost: float | None = None,
        failed: str | None = None,
        measured: Mapping[str, float] | None = None,
        seconds: Mapping[str, float] | None = None,
    ) -> Trial:
        """Store what came of trial ``number``, and tell the search: exactly one of an episode, a cost or a reason.

        Parameters
        ----------
        number
            Of a trial that was asked and not yet told.
        episode
            Its record, which is scored as the study says; its own failure or cut is the trial's.
        cost
            J that was measured elsewhere.
        failed
            Why it gave no J.
        measured
            With ``cost``: values of the study's limits, by name.
        seconds
            Wall time of its parts, s.

        Raises
        ------
        RunError
            The trial was not asked, or told already; a value of a limit is missing.
        ValueError
            Not exactly one outcome; a cost that is negative or not finite. Nothing is stored then.
        """
        asked = self._asked(number)
        if sum(outcome is not None for outcome in (episode, cost, failed)) != 1:
            raise ValueError(f"trial {number} is told by exactly one of an episode, a cost and a reason of failure")
        if cost is not None:
            if cost < 0:
                raise ValueError(f"the cost {cost} is negative, but the study's is a sum of squares: tell that one")
            self._check_measured(number, measured)
            outcome = {"outcome": "done", "J": float(cost), "measured": dict(measured) if measured else None}
        elif episode is not None:
            outcome = judged(self.study, episode)
        else:
            outcome = {"outcome": "failed", "failure": failed}
        spent = asked.seconds | dict(seconds or {})
        if "trial" in spent:
            spent["trial"] += sum(asked.seconds.values())
        if reason := outcome.get("failure"):  # what a plant raised may hold what no text file takes
            outcome["failure"] = reason.encode(errors="backslashreplace").decode()
        trial = Trial(**vars(replace(asked, seconds=spent)), told=self._events() + 1, **outcome)
        tell_search(self._search, trial)  # refuses what it cannot model, before it is stored
        try:
            self._journal.add_told(trial, episode)
        except BaseException:
            self._search = replayed(self.study.optimizer(), self._trials)
            raise
        del self._pending[number]
        self._trials.append(trial)
        return trial

    def take_back(self, number: int) -> Trial:
        """Let trial ``number`` be out again, as if nothing had been told of it, and return it as it was told.

        The journal keeps what was told. What was asked since stays as it is: it was asked in the belief of it.

        Raises
        ------
        RunError
            Nothing was told of that trial.
        """
        trial = next((trial for trial in self._trials if trial.number == number), None)
        if trial is None:
            told = ", ".join(str(trial.number) for trial in self._trials) or "none"
            raise RunError(f"nothing was told of trial {number} of {self.folder}; told: {told}")
        asked = Asked(**{name: getattr(trial, name) for name in Asked.__dataclass_fields__})
        asked = replace(asked, seconds={name: trial.seconds.get(name, 0.0) for name in asdict(Timings())})
        self._journal.take_back(asked, self._events() + 1)
        self._taken_back += 1
        self._trials.remove(trial)
        self._pending = dict(sorted((self._pending | {number: asked}).items()))
        self._search = replayed(self.study.optimizer(), self._trials)
        return trial

    def _asked(self, number: int) -> Asked:
        if (asked := self._pending.get(number)) is None:
            told = any(trial.number == number for trial in self._trials)
            out = ", ".join(map(str, self._pending)) or "none"
            was = "told already" if told else "never asked"
            first = "" if told else f"; ask first: socasadi ask {shlex.quote(str(self.folder))}"
            raise RunError(f"trial {number} of {self.folder} was {was}; not told yet: {out}{first}")
        return asked

    def _check_measured(self, number: int, measured: Mapping[str, float] | None) -> None:
        lacking = [limit.name for limit in self.study.limits if limit.name not in (measured or {})]
        if lacking:
            raise RunError(
                f"trial {number} cannot be told by its cost alone, since the study limits {', '.join(lacking)}: tell "
                "its recording"
            )

    def _events(self) -> int:
        return 2 * (len(self._trials) + self._taken_back) + len(self._pending)
