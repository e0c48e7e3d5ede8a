"""What somebody who flies a trial by hand is given: theta, the controller's numbers, and the C that they belong to."""

import json
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..export import ControllerRecord, check_single_precision, data_header, export_sources
from ..mpc import DesignError, Real
from ._provenance import provenance
from .experiment import Units
from .store import Asked, RunError

if TYPE_CHECKING:
    from ._study import Study

_SETTINGS = "controller.json"


@dataclass(frozen=True)
class Bench:
    """The part of a run folder that belongs to those who fly its trials by hand.

    ``controller-c`` holds the C that no trial changes; ``asked/trial-NNN`` holds what one trial changes: ``theta.json``
    and ``controller_data.h``, without which that C does not compile.

    Attributes
    ----------
    study, folder
        The study and its run folder.
    real
        What the C computes in.
    """

    study: "Study"
    folder: Path
    real: Real = "double"

    @classmethod
    def of(cls, study: "Study", folder: Path) -> "Bench":
        """That of a run folder, in what was chosen when it was made; double otherwise."""
        path = folder / _SETTINGS
        if not path.exists():
            return cls(study, folder)
        try:
            return cls(study, folder, **json.loads(path.read_text()))
        except (ValueError, TypeError) as error:
            raise RunError(f"{path} is damaged ({error}); restore it from a copy") from error

    def computing_in(self, real: Real) -> "Bench":
        """The same in another precision; RunError when that of the run was chosen already."""
        if real != self.real and (self.folder / _SETTINGS).exists():
            raise RunError(f"the controllers of {self.folder} compute in {self.real}: they cannot change to {real}")
        return replace(self, real=real)

    @property
    def sources(self) -> Path:
        """Where the C lies that no trial changes."""
        return self.folder / "controller-c"

    def trial(self, number: int) -> Path:
        """Where what trial ``number`` changes lies."""
        return self.folder / "asked" / f"trial-{number:03d}"

    @property
    def samples(self) -> int:
        """Number of samples in a trial."""
        return self.study.task.samples(self.study.mpc.sample_time)

    @property
    def columns(self) -> dict[str, str]:
        """Columns of a trial's recording and their units."""
        return Units.of(self.study.plant).columns(self.study.mpc)

    def prepare(self) -> None:
        """Write the C that no trial changes, if a model in the middle of the box gives a controller."""
        (self.folder / _SETTINGS).write_text(json.dumps({"real": self.real}) + "\n")
        entries = self.study.mpc.entries
        # Off the middle, where gains that may have either sign are 0 and nothing can be controlled.
        middle = [
            np.sqrt(e.lower * e.upper) if e.scale == "log" else e.lower + 0.6 * (e.upper - e.lower) for e in entries
        ]
        try:
            self._write_sources(np.array(middle))
        except DesignError:
            return

    def lay_out(self, asked: Asked) -> Path:
        """Write what a trial needs, and return its folder.

        Raises
        ------
        DesignError
            Its theta gives no controller.
        ExportError
            Single precision does not do for its controller, or cannot be tried.
        """
        mpc, system = self.study.mpc.at(asked.theta), self.study.mpc.system(asked.theta)
        if self.real == "float":
            check_single_precision(ControllerRecord.simulated(mpc, system))
        told = (f"trial {asked.number} of {self.folder.name}, to be flown", *provenance(self.study, asked.theta))
        header = data_header(mpc, system, real=self.real, provenance=told)
        if not self.sources.is_dir():
            self._write_sources(asked.theta)
        folder = self.trial(asked.number)
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "controller_data.h").write_text(header)
        (folder / "theta.json").write_text(json.dumps(self.about(asked), indent=2) + "\n")
        return folder

    def about(self, asked: Asked) -> dict[str, Any]:
        """All of a trial that a program needs, as plain data."""
        entries = self.study.mpc.entries
        return {
            "trial": asked.number,
            "phase": asked.phase,
            "asked": asked.started,
            "give_up": asked.give_up,
            "theta": {e.name: value for e, value in zip(entries, asked.theta.tolist(), strict=True)},
            "units": {e.name: e.unit for e in entries},
            "header": str(self.trial(asked.number) / "controller_data.h"),
            "sources": str(self.sources),
            "sample_time": self.study.mpc.sample_time,
            "samples": self.samples,
            "columns": self.columns,
            "pulse": asdict(self.study.task.pulse) if self.study.task.pulse else None,
        }

    def _write_sources(self, theta: np.ndarray) -> None:
        mpc, task = self.study.mpc.at(theta), self.study.task
        instants = mpc.sample_time * np.arange(self.samples + 1 + mpc.reference_rows)
        system, reference = self.study.mpc.system(theta), task.reference(instants)
        note = f"In each trial, {task.pulse.in_words}." if task.pulse else ""
        export_sources(mpc, system, reference, self.sources, real=self.real, note=note)
