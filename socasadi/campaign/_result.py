import functools
import hashlib
import json
import textwrap
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..export import ControllerRecord, export
from .experiment import Episode
from .store import Flight, Journal, JournalError, Trial, describe

if TYPE_CHECKING:
    from ._study import Study


class RunError(RuntimeError):
    """A run folder that cannot be used as asked."""


def journal_path(folder: Path) -> Path:
    """Where a run folder keeps its journal."""
    return folder / "journal.sqlite"


def read_settings(folder: Path) -> dict:
    """Settings of the study that ``folder`` holds; RunError when it holds none."""
    path = folder / "study.json"
    try:
        return json.loads(path.read_text())["settings"]
    except FileNotFoundError:
        raise RunError(f"{folder} is no run folder: it has no study.json") from None
    except (ValueError, KeyError, TypeError) as error:
        raise RunError(f"{path} is damaged ({error!r}); restore it from a copy") from error


def best_trial(trials: list[Trial]) -> Trial | None:
    """The trial of least J, the first of equals; None while all have failed."""
    return min((trial for trial in trials if trial.J is not None), key=lambda trial: trial.J or 0.0, default=None)


@dataclass(frozen=True, eq=False)
class Result:
    """A run, finished or not, as its folder holds it.

    Attributes
    ----------
    study, folder
        What was run, and where it is stored.
    """

    study: "Study"
    folder: Path

    @classmethod
    def open(cls, folder: str | Path) -> "Result":
        """The run in ``folder``, without its study script.

        Raises
        ------
        RunError
            There is no run in it, or only its study script can make a part of the study other than the robot.
        """
        from ._study import Study

        folder = Path(folder)
        if not folder.is_dir():
            raise RunError(f"there is no run folder {folder}")
        settings = read_settings(folder)
        try:
            return cls(Study.from_settings(settings), folder)
        except (ValueError, TypeError, KeyError, AttributeError, ImportError) as error:
            raise RunError(f"the study of {folder} cannot be made from its study.json: {error}") from error

    @functools.cached_property
    def trials(self) -> list[Trial]:
        """All trials so far, in order."""
        with self._journal() as journal:
            return journal.trials()

    @property
    def best(self) -> Trial:
        """The trial of least J; RunError when none succeeded."""
        best = best_trial(self.trials)
        if best is None:
            reasons = "; ".join(sorted({trial.failure or "" for trial in self.trials})[:3])
            raise RunError(
                f"none of the {len(self.trials)} trials in {self.folder} succeeded: {reasons or 'none was made'}"
            )
        return best

    @property
    def complete(self) -> bool:
        """Whether all trials of the study are there."""
        return len(self.trials) >= self.study.trials

    def episode(self, number: int) -> Episode:
        """Record of trial ``number``; RunError when there is none."""
        with self._journal() as journal:
            try:
                episode = journal.episode(number)
            except KeyError:
                raise RunError(f"{self.folder} has no trial {number}; it has {len(self.trials)}") from None
        if episode is None:
            raise RunError(f"trial {number} has no record: its controller could not be made")
        return episode

    def flights(self) -> dict[str, Flight]:
        """Flights beside the search, by name (see :func:`assess`)."""
        with self._journal() as journal:
            return journal.flights()

    def export(
        self, folder: str | Path, *, real: str = "double", solver: str = "active-set", name: str = "controller"
    ) -> Path:
        """Write the best trial's controller as C, with its episode to replay; see :func:`socasadi.export.export`."""
        return export(self.controller_record(), folder, real=real, solver=solver, name=name)

    def controller_record(self) -> ControllerRecord:
        """The best trial's controller with its episode, as :func:`socasadi.export.export` takes it."""
        best, mpc = self.best, self.study.mpc
        episode = self.episode(best.number)
        samples = len(episode.tension)
        ahead = np.arange(1, mpc.reference_rows + 1)
        preview = [self.study.task.reference((t + ahead) * mpc.sample_time) for t in range(samples)]
        entries = zip(mpc.model.entries, best.theta, strict=True)
        digest = hashlib.sha256(journal_path(self.folder).read_bytes()).hexdigest()
        return ControllerRecord(
            mpc=mpc,
            system=mpc.model.state_space(best.theta, mpc.sample_time),
            output=episode.output[:samples],
            preview=np.array(preview),
            held=episode.held,
            disturbance=episode.disturbance if mpc.measured_disturbances else None,
            provenance=(
                f"trial {best.number} of {len(self.trials)}, J = {best.J!r}",
                f"prediction model {type(mpc.model).__name__}, theta:",
                *[
                    f"    {entry.name} = {float(value)!r} {entry.unit.removesuffix('1')}".rstrip()
                    for entry, value in entries
                ],
                *_told("MPC", mpc),
                *_told("task", self.study.task),
                *_told("cost", self.study.cost),
                f"search {self.study.search}, seed {self.study.seed}",
                f"sha256 of the journal {digest}",
            ),
        )

    def _journal(self) -> Journal:
        path = journal_path(self.folder)
        if not path.exists():
            raise JournalError(
                f"{self.folder} has no journal.sqlite: restore it from a copy, or start anew in another folder"
            )
        return Journal(path)


def _told(title: str, part: object) -> list[str]:
    """Every setting of a part of a study but its model, in lines of a header."""
    settings = {name: value for name, value in describe(part).items() if name != "model"}
    kind = settings.pop("type").rpartition(".")[2]
    told = ", ".join(f"{name} = {json.dumps(value)}" for name, value in settings.items())
    return textwrap.wrap(f"{title} {kind}: {told}", 110, subsequent_indent="    ", break_long_words=False)
