import json
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

from ...campaign import Episode, ForeignTypeError, Journal, Result, Study, Trial, Verdict, assessed
from ...campaign.store import journal_path, read_settings
from ...feasibility import Check, check
from ...plant import ExternalPlant, SimulatedPlant
from ...tune import Estimate, Sensitivity

T = TypeVar("T")


@dataclass(eq=False)
class Pieces:
    """What a run folder holds for its report; what is not there is None or empty, and named in ``missing``.

    ``damaged`` is whether the settings or the journal are among that, without which no run is.
    """

    folder: Path
    settings: dict[str, Any] = field(default_factory=dict)
    study: Study | None = None
    trials: list[Trial] = field(default_factory=list)
    best: Trial | None = None
    chosen: Trial | None = None
    estimate: Estimate | None = None
    baseline: list[Trial] = field(default_factory=list)
    verdicts: dict[str, Verdict] = field(default_factory=dict)
    sensitivity: Sensitivity | None = None
    found: Check | None = None
    costs: list[list[str]] = field(default_factory=list)
    pending: int = 0
    missing: list[str] = field(default_factory=list)
    damaged: bool = False
    _result: Result | None = None

    @classmethod
    def gather(cls, folder: Path, study: Study | None = None, found: Check | None = None) -> "Pieces":
        """Everything that can be read in ``folder``; ``study`` stands in for one that its settings cannot make."""
        pieces = cls(folder, found=found)
        pieces._read(study)
        return pieces

    def episode(self, number: int) -> Episode | None:
        """The record of a trial; None where there is none, or it is damaged, which is noted."""
        with Journal(journal_path(self.folder)) as journal:
            return self._try(f"the record of trial {number}", lambda: journal.episode(number), None, core=True)

    def kept(self, trial: Trial) -> bool:
        """Whether a trial is done and kept all limits."""
        return trial.J is not None if self._result is None else self._result.kept(trial)

    def _read(self, study: Study | None) -> None:
        folder = self.folder
        self.settings = self._try("study.json", lambda: _whole_settings(folder), {}, core=True)
        self.study = study or self._try("the study", lambda: Result.open(folder).study, None, core=True)
        self.trials = self._try("the journal", lambda: _trials(folder), [], core=True)
        if self.study is None:
            self.best = min((t for t in self.trials if t.J is not None), key=lambda t: t.J or 0.0, default=None)
            return
        self._result = result = Result(self.study, folder)
        if self.trials:
            self.best = self._try("a best trial", lambda: result.best, None)
        if self.best is not None:
            self.chosen = self._try("the trial that is exported", lambda: result.chosen, self.best)
            self.verdicts = self._try("the flights under fresh noise", lambda: assessed(result), {})
            self.estimate = self._try("the estimate of the best", lambda: result.best_estimated, None)
            self.sensitivity = self._try("the sensitivity of theta", lambda: result.sensitivity, None)
        if self.trials or journal_path(folder).is_file():
            self.pending = self._try("the trials that are out", lambda: len(result.pending), 0)
        if not isinstance(self.study.plant, ExternalPlant):  # of a robot flown elsewhere none of these is ever made
            if self.best is not None and not self.verdicts:
                self.missing.append("flights under fresh noise: the best theta was not flown again")
            self.baseline = self._try("the Sobol baseline", lambda: _trials(folder / "sobol"), [])
            if self.rod_plant is None:
                self.missing.append("the robot's shape: only simulated rods have one")
        made = self.study
        self.found = self.found or self._try("the check", lambda: check(made), None)
        self.costs = self._try("the exported controller", lambda: _costs(folder / "controller"), [])

    @property
    def rod_plant(self) -> SimulatedPlant | None:
        """The plant, where it is a rod that can be drawn."""
        plant = self.study and self.study.plant
        return plant if isinstance(plant, SimulatedPlant) and not plant.rod.parameters else None

    def _try(self, what: str, make: Callable[[], T], otherwise: T, core: bool = False) -> T:
        """What ``make`` makes, or ``otherwise``; ``core`` pieces are the settings and the journal."""
        try:
            return make()
        except Exception as error:  # whatever is wrong with a piece, the others are still worth a page
            foreign = isinstance(error.__cause__, ForeignTypeError)  # which its study script can make
            self.damaged = self.damaged or (core and not foreign)
            kind = "" if isinstance(error, (RuntimeError, ValueError, OSError)) else f"{type(error).__name__}: "
            self.missing.append(f"{what}: {kind}{error}")
            return otherwise


def _whole_settings(folder: Path) -> dict[str, Any]:
    read_settings(folder)  # which says what is wrong with them
    return json.loads((folder / "study.json").read_text(encoding="utf-8"))


def _trials(folder: Path) -> list[Trial]:
    path = journal_path(folder)
    if not path.is_file():
        raise FileNotFoundError(f"there is no {path}")
    with Journal(path) as journal:
        return journal.trials()


def _costs(folder: Path) -> list[list[str]]:
    """Rows of the table of what the controller costs, in the page of its export."""
    page = folder / "README.md"
    if not page.is_file():
        raise FileNotFoundError(f"there is no {page}; socasadi export {folder.parent} --out {folder} makes it")
    _, _, after = page.read_text(encoding="utf-8").partition("## What it costs")
    rows = [[cell.strip() for cell in line.split("|")[1:-1]] for line in after.splitlines() if line[:1] == "|"]
    return [row for row in rows if set("".join(row)) - set("- ")]
