import functools
import hashlib
import shlex
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..export import ControllerRecord, export
from ..plant import ExternalPlant
from ..tune import Estimate, Optimizer, Sensitivity
from ._provenance import provenance
from .execution import best_trial, flown_cost, keeps_limits, replayed
from .experiment import Episode
from .store import Asked, Flight, Journal, RunError, Trial, journal_path, read_settings

if TYPE_CHECKING:
    from ._study import Study


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
        """All trials that were told so far, in the order of telling."""
        with self._journal() as journal:
            return journal.trials()

    @property
    def pending(self) -> list[Asked]:
        """Trials that were asked and not told, in the order of asking."""
        with self._journal() as journal:
            return journal.pending()

    @property
    def taken_back(self) -> list[Trial]:
        """What was told and taken back (see :meth:`Campaign.take_back`), in the order of taking back."""
        with self._journal() as journal:
            return [trial for _, trial in journal.taken_back()]

    @property
    def best(self) -> Trial:
        """The best observed: of least J among those that kept all limits; RunError when none did."""
        best = best_trial(self.trials, self.study)
        if best is None and not self.trials:
            raise RunError(self.begin)
        if best is None:
            reasons = "; ".join(self._why_none_succeeded()[:3])
            raise RunError(f"none of the {len(self.trials)} trials in {self.folder} succeeded: {reasons}")
        return best

    @property
    def begin(self) -> str:
        """What to do with a run of which nothing was told yet, in a sentence."""
        folder = shlex.quote(str(self.folder))
        ask = f"ask and tell (socasadi ask {folder})"
        if out := len(self.pending):
            are, them = ("is", "it") if out == 1 else ("are", "them")
            return f"no trial of {self.folder} was told yet, {out} {are} out: tell what came of {them} (socasadi tell)"
        if isinstance(self.study.plant, ExternalPlant):
            return f"{self.folder} has no trials yet: {ask}"
        return f"{self.folder} has no trials yet: run it (socasadi run STUDY --out {folder} --resume), or {ask}"

    @functools.cached_property
    def best_estimated(self) -> Estimate | None:
        """The trial whose J without noise the search estimates lowest, with an interval; None before it can.

        Its ``index`` is a place in :attr:`trials`.
        """
        return replayed(self.study.optimizer(), self.trials).best_estimated

    @functools.cached_property
    def sensitivity(self) -> Sensitivity | None:
        """How J depends on each entry of theta about the :attr:`chosen` one, as far as the search knows.

        None when the search has no model of J, as that of Sobol points.
        """
        search = self.study.optimizer()
        if not isinstance(search, Optimizer):
            return None
        replayed(search, self.trials)
        return search.sensitivity(self.chosen.theta)

    @property
    def chosen(self) -> Trial:
        """The trial whose controller is exported.

        Of those that :func:`assess` flew again it is the one of least mean J (one that failed or broke a limit there
        comes last), since the best observed owes a part of its J to the noise; while the best has not been flown again
        it is the best.
        """
        best = self.best
        costs: dict[tuple[float, ...], list[float]] = {}
        for flight in self.flights().values():
            if flight.theta is not None:
                costs.setdefault(tuple(flight.theta.tolist()), []).append(flown_cost(flight, self.study))
        if tuple(best.theta.tolist()) not in costs:
            return best
        flown = [trial for trial in self.trials if self.kept(trial) and tuple(trial.theta.tolist()) in costs]
        return min(flown, key=lambda trial: np.mean(costs[tuple(trial.theta.tolist())]))

    def _why_none_succeeded(self) -> list[str]:
        done = [trial.measured or {} for trial in self.trials if trial.J is not None]
        least = {limit: min(measured[limit.name] for measured in done) for limit in self.study.limits if done}
        broken = [
            f"{limit.name} was {value:.3g} {limit.unit} at least, above its limit of {limit.limit:g}"
            for limit, value in least.items()
            if value > limit.limit
        ]
        if done and not broken:
            broken = [f"none kept all of {', '.join(limit.name for limit in self.study.limits)} at once"]
        failures = sorted({trial.failure for trial in self.trials if trial.failure})
        return broken + failures

    def kept(self, trial: Trial) -> bool:
        """Whether a trial is done and kept all limits of the study."""
        return keeps_limits(trial, self.study)

    @property
    def plant_seconds(self) -> float:
        """The robot's time that the trials took, s."""
        return sum(trial.plant_seconds or 0.0 for trial in self.trials)

    @property
    def saved_seconds(self) -> float:
        """The robot's time that was not spent, because hopeless trials were cut, s."""
        return sum(trial.saved_seconds or 0.0 for trial in self.trials)

    @property
    def complete(self) -> bool:
        """Whether all trials of the study are there."""
        return len(self.trials) >= self.study.trials

    def episode(self, number: int) -> Episode:
        """Record of trial ``number``; RunError when there is none."""
        if (episode := self._episode(number)) is None:
            raise RunError(
                f"trial {number} has no record: it is out, its controller could not be made, or J was told alone"
            )
        return episode

    def recorded(self, number: int) -> bool:
        """Whether trial ``number`` has a record, which one that was told by its cost alone has not."""
        return self._episode(number) is not None

    def _episode(self, number: int) -> Episode | None:
        with self._journal() as journal:
            try:
                return journal.episode(number)
            except KeyError:
                raise RunError(f"{self.folder} has no trial {number}; it has {len(self.trials)}") from None

    def flights(self) -> dict[str, Flight]:
        """Flights beside the search, by name (see :func:`assess`)."""
        with self._journal() as journal:
            return journal.flights()

    def export(
        self, folder: str | Path, *, real: str = "double", solver: str = "active-set", name: str = "controller"
    ) -> Path:
        """Write the :attr:`chosen` controller as C, with its episode to replay; see :func:`socasadi.export.export`."""
        return export(self.controller_record(), folder, real=real, solver=solver, name=name)

    def controller_record(self) -> ControllerRecord:
        """The :attr:`chosen` trial's controller with its episode, as :func:`socasadi.export.export` takes it.

        Where J was told alone, the controller is simulated on its own model instead.
        """
        best = self.chosen
        mpc, system = self.study.mpc.at(best.theta), self.study.mpc.system(best.theta)
        if (episode := self._episode(best.number)) is None:
            return replace(ControllerRecord.simulated(mpc, system), provenance=self._provenance(best))
        samples = len(episode.tension)
        ahead = np.arange(1, mpc.reference_rows + 1)
        preview = [self.study.task.reference((t + ahead) * mpc.sample_time) for t in range(samples)]
        return ControllerRecord(
            mpc=mpc,
            system=system,
            output=episode.output[:samples],
            preview=np.array(preview),
            held=episode.held,
            disturbance=episode.disturbance if mpc.measured_disturbances else None,
            provenance=self._provenance(best),
        )

    def _provenance(self, trial: Trial) -> tuple[str, ...]:
        digest = hashlib.sha256(journal_path(self.folder).read_bytes()).hexdigest()
        return (
            f"trial {trial.number} of {len(self.trials)}, J = {trial.J!r}",
            *provenance(self.study, trial.theta),
            f"sha256 of the journal {digest}",
        )

    def _journal(self) -> Journal:
        return Journal(journal_path(self.folder))
