"""Trials one after another or side by side, each stored before the next is asked."""

from ._campaign import Campaign
from ._dask import DaskExecutor, dask_executor
from ._flight import fly_once
from ._loop import check_run, run_campaign
from ._outcome import best_trial, flown_cost, keeps_limits, replayed
from ._processes import Processes
from ._progress import Clock, Progress, clock, print_progress, progress_line
from ._script import load_script, load_study
from ._stream import Stream, drawn_seed

__all__ = [
    "Campaign",
    "Clock",
    "DaskExecutor",
    "Processes",
    "Progress",
    "Stream",
    "best_trial",
    "check_run",
    "clock",
    "dask_executor",
    "drawn_seed",
    "flown_cost",
    "fly_once",
    "keeps_limits",
    "load_script",
    "load_study",
    "print_progress",
    "progress_line",
    "replayed",
    "run_campaign",
]
