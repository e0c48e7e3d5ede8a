"""One experiment: the task, the flight of a controller along it, and what it is judged to be worth."""

from ._conditions import ClosedLoopStability, Condition, IterationBound, admissible, check_conditions
from ._cost import Cost, Meter, Score
from ._episode import Episode, Pilot, fly, measured
from ._interrupt import check_interrupt, interruptible
from ._limits import (
    Limit,
    MeasuredLimit,
    Overshoot,
    SettlingTime,
    ViolatedOutputs,
    check_limits,
    measure_limits,
)
from ._probe import probe
from ._recognise import recognise
from ._recording import RecordingError, Units, read_probe, read_recording, resting_input, write_recording
from ._task import Circle, FigureEight, Origin, Pulse, SetPoints, Task

__all__ = [
    "Circle",
    "ClosedLoopStability",
    "Condition",
    "Cost",
    "Episode",
    "FigureEight",
    "IterationBound",
    "Limit",
    "MeasuredLimit",
    "Meter",
    "Origin",
    "Overshoot",
    "Pilot",
    "Pulse",
    "RecordingError",
    "Score",
    "SetPoints",
    "SettlingTime",
    "Task",
    "Units",
    "ViolatedOutputs",
    "admissible",
    "check_conditions",
    "check_interrupt",
    "check_limits",
    "fly",
    "interruptible",
    "measure_limits",
    "measured",
    "probe",
    "read_probe",
    "read_recording",
    "recognise",
    "resting_input",
    "write_recording",
]
