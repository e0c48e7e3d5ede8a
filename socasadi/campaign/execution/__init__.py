"""Trials one after another or side by side, each stored before the next is asked."""

from ._progress import Clock, Progress, clock, print_progress, progress_line

__all__ = ["Clock", "Progress", "clock", "print_progress", "progress_line"]
