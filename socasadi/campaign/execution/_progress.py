import time
from dataclasses import dataclass

from ..store import Trial


@dataclass(frozen=True)
class Progress:
    """Where a run stands after a trial was told.

    Attributes
    ----------
    trial, best
        The trial just stored, and the best so far (None while none succeeded).
    done, total
        Numbers of trials, told and in all; side by side they are not told in the order of their numbers.
    elapsed, remaining
        s of wall time in this session, and to the end at the pace of the last trials.
    broken
        The limits that the trial did not keep, in words.
    """

    trial: Trial
    best: Trial | None
    done: int
    total: int
    elapsed: float
    remaining: float
    broken: tuple[str, ...] = ()


class Clock:
    """Estimates the time left from the last few trials, since asking grows dearer along the way."""

    def __init__(self) -> None:
        self.start = time.monotonic()
        self._ends = [self.start]

    def tick(self, left: int) -> tuple[float, float]:
        """Time elapsed, and remaining for ``left`` more trials, s."""
        self._ends = [*self._ends[-10:], time.monotonic()]
        pace = (self._ends[-1] - self._ends[0]) / (len(self._ends) - 1)
        return self._ends[-1] - self.start, pace * left


def print_progress(progress: Progress) -> None:
    """One line a trial on standard output."""
    print(progress_line(progress), flush=True)


def progress_line(progress: Progress, *, short: bool = False) -> str:
    """The line: trial, its J, the best J, time elapsed and remaining; ``short`` for beside a bar that counts trials."""
    trial, best = progress.trial, progress.best
    times = clock(progress.elapsed), clock(progress.remaining)
    nothing = "limits not kept yet" if progress.broken else "no success yet"
    if short:
        outcome = _outcome(trial, ".4g") + ("!" if progress.broken else "")
        incumbent = nothing if best is None else f"best {best.J:.4g} (trial {best.number})"
        return f"{outcome:12} {incumbent:24} {times[0]} + {times[1]} left"
    width = len(str(progress.total))
    outcome = f"{_outcome(trial, '12.5g'):>14}"
    incumbent = f"best {best.J:10.5g} (trial {best.number})" if best is not None else nothing
    reason = f"  {trial.failure}" if trial.outcome == "failed" else "".join(f"  {told}" for told in progress.broken)
    return (
        f"trial {trial.number:{width}}/{progress.total}  {outcome}  {incumbent}  "
        f"{times[0]} elapsed, {times[1]} left{reason}"
    )


def _outcome(trial: Trial, digits: str) -> str:
    match trial.outcome:
        case "done":
            return f"J {trial.J:{digits}}"
        case "cut":
            return f"cut, J > {trial.at_least:.4g}"
        case "failed":
            return "failed"


def clock(seconds: float) -> str:
    """Minutes and seconds, with hours when there are any."""
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02}:{rest:02}" if hours else f"{minutes}:{rest:02}"
