"""Experiments and the search over them: tasks, cost, episodes, the journal, and the study that ties them together."""

from ._assess import Assessment, Verdict, assess
from ._cost import Cost, Score
from ._emulate import ProcessorInTheLoop, emulate
from ._episode import Episode, fly
from ._interrupt import interruptible
from ._journal import Flight, Journal, JournalError, Trial
from ._probe import probe
from ._progress import Progress, clock, print_progress, progress_line
from ._result import Result, RunError
from ._settings import ForeignTypeError
from ._study import Study
from ._task import Circle, Origin, Pulse, Task

__all__ = [
    "Assessment",
    "Circle",
    "Cost",
    "Episode",
    "Flight",
    "ForeignTypeError",
    "Journal",
    "JournalError",
    "Origin",
    "ProcessorInTheLoop",
    "Progress",
    "Pulse",
    "Result",
    "RunError",
    "Score",
    "Study",
    "Task",
    "Trial",
    "Verdict",
    "assess",
    "clock",
    "emulate",
    "fly",
    "interruptible",
    "print_progress",
    "probe",
    "progress_line",
]
