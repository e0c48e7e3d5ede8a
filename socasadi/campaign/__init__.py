"""Experiments and the search over them: tasks, cost, episodes, the journal, and the study that ties them together."""

from ._assess import Assessment, Verdict, assess
from ._emulate import ProcessorInTheLoop, emulate
from ._result import Result, RunError
from ._study import Study
from .execution import Progress, clock, print_progress, progress_line
from .experiment import Circle, Cost, Episode, Origin, Pulse, Score, Task, fly, interruptible, probe
from .store import Flight, ForeignTypeError, Journal, JournalError, Trial

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
