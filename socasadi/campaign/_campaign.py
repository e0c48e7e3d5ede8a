import importlib.metadata
import json
import platform
import time
from collections.abc import Callable
from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..mpc import DesignError
from ..tune import Search
from ._result import Result, RunError, best_trial, journal_path, read_settings
from .execution import Clock, Progress
from .experiment import Episode, Pilot, fly, interruptible
from .store import Journal, Trial, differences

if TYPE_CHECKING:
    from ._study import Study

_MAY_DIFFER = ("iterations", "verifications")


def run_campaign(study: "Study", folder: Path, *, resume: bool, progress: Callable[[Progress], None] | None) -> Result:
    """Ask, build, fly, score, store, tell, until the study has its trials; see :meth:`Study.run`."""
    _check_folder(study, folder, resume)
    with interruptible(), Journal(journal_path(folder), writer=True) as journal:
        trials, search, clock = journal.trials(), study.optimizer(), Clock()
        if len(trials) > study.trials:
            raise RunError(f"{folder} holds {len(trials)} trials already; ask for no fewer, not for {study.trials}")
        _write_settings(study, folder)
        if prepare := getattr(study.plant, "prepare", None):
            prepare()
        for trial in trials:
            _tell(search, trial)
        while len(trials) < study.trials:
            trial, episode = _try_next(study, search, number=len(trials) + 1)
            journal.add_trial(trial, episode)
            _tell(search, trial)
            trials.append(trial)
            if progress is not None:
                elapsed, remaining = clock.tick(study.trials - len(trials))
                progress(Progress(trial, best_trial(trials), len(trials), study.trials, elapsed, remaining))
    return Result(study, folder)


def _check_folder(study: "Study", folder: Path, resume: bool) -> None:
    """Make the run folder, or see that it is this study's."""
    if folder.exists() and not folder.is_dir():
        raise RunError(f"{folder} is a file; name a folder for the run")
    if folder.exists() and any(folder.iterdir()):
        if not resume:
            raise RunError(f"{folder} exists already; resume it (--resume), or name another folder")
        changed = [
            line for line in differences(read_settings(folder), study.settings) if line.split(" ")[0] not in _MAY_DIFFER
        ]
        if changed:
            raise RunError(f"{folder} holds a run with other settings: {'; '.join(changed)}")
        return
    folder.mkdir(parents=True, exist_ok=True)
    # First of all, so that a run that is killed at any later moment can be resumed.
    _write_settings(study, folder)


def _write_settings(study: "Study", folder: Path) -> None:
    about = {
        "settings": study.settings,
        "versions": {
            name: importlib.metadata.version(name) for name in ("socasadi", "casadi", "numpy", "scipy", "GPy")
        },
        "python": platform.python_version(),
        "machine": platform.machine(),
    }
    scratch = folder / "study.json.new"
    scratch.write_text(json.dumps(about, indent=2) + "\n")
    scratch.replace(folder / "study.json")


def _try_next(study: "Study", search: Search, number: int) -> tuple[Trial, Episode | None]:
    started, begin = datetime.now(UTC).isoformat(timespec="seconds"), time.perf_counter()
    theta = search.ask()
    asked = time.perf_counter()
    seconds = asdict(search.timings)
    episode, score = None, None
    try:
        controller = study.mpc.controller(theta)
    except DesignError as error:
        failure = f"DesignError: {error}"
    else:
        seconds |= {"design": time.perf_counter() - asked}
        episode = fly_once(study, controller, stream=(0, number))
        seconds |= episode.seconds
        failure = episode.failure
        if failure is None:
            score = study.cost.score(episode, study.mpc.input_scale)
            if not all(np.isfinite(list(asdict(score).values()))):
                failure, score = f"the cost is not finite: {score}", None
    seconds |= {"trial": time.perf_counter() - begin}
    phase = "seed" if number <= study.seed_points else "search"
    return Trial(number, phase, theta, score, failure, started, seconds), episode


def fly_once(study: "Study", controller: Pilot, stream: tuple[int, ...]) -> Episode:
    """One episode of the study, its noise drawn from the study's seed and ``stream``."""
    seed = int(np.random.SeedSequence([study.seed, *stream]).generate_state(1)[0])
    return fly(study.plant, controller, study.task, seed=seed, time_limit=study.time_limit)


def _tell(search: Search, trial: Trial) -> None:
    search.tell(trial.theta, trial.J, failed=trial.J is None)
