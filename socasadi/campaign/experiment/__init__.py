"""One experiment: the task, the flight of a controller along it, and what it is judged to be worth."""

from ._cost import Cost, Score
from ._episode import Episode, Pilot, fly, measured
from ._interrupt import check_interrupt, interruptible
from ._probe import probe
from ._task import Circle, Origin, Pulse, Task

__all__ = [
    "Circle",
    "Cost",
    "Episode",
    "Origin",
    "Pilot",
    "Pulse",
    "Score",
    "Task",
    "check_interrupt",
    "fly",
    "interruptible",
    "measured",
    "probe",
]
