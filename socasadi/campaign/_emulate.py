"""Processor in the loop: the best controller on an emulated microcontroller, the plant simulated here."""

import json
import tempfile
from dataclasses import asdict, dataclass, replace

import numpy as np

from ..export import RANDOM_SAMPLES, Emulated, EmulatorError, Footprint, build, core_for, export, toolchain
from ..mpc import Real, check_real
from ._result import Result
from .experiment import Episode, fly
from .store import RunError


@dataclass(frozen=True, eq=False)
class ProcessorInTheLoop:
    """One episode with the controller on an emulated microcontroller.

    Attributes
    ----------
    core, real
        The microcontroller, and what it computes in.
    episode
        What the robot did.
    footprint
        Flash, RAM, stack and instructions of the controller in this episode.
    worst
        The same over the episode and random samples, most of them with active bounds.
    difference
        Largest difference between its inputs and those that the same C gives in the same episode flown with a
        controller compiled for this machine, as a share of the input bound.
    """

    core: str
    real: str
    episode: Episode
    footprint: Footprint
    worst: Footprint
    difference: float


def emulate(result: Result, *, real: Real = "float") -> ProcessorInTheLoop:
    """Fly the best controller of a run on an emulated microcontroller: Cortex-M4F in float, Cortex-M7 in double.

    The figures are kept in microcontroller-REAL.json in the run folder.

    Raises
    ------
    EmulatorError
        The cross compiler or the emulator is missing (the message names the packages), or the controller fails on it.
    ExportError
        The controller cannot be exported in ``real``.
    RunError
        The run has no trials, or the episode failed.
    """
    check_real(real)
    study, core = result.study, core_for(real)
    theta, mpc = result.chosen.theta, replace(study.mpc, backend="active-set")
    if reason := toolchain():
        raise EmulatorError(reason)
    settings = {"seed": study.seed, "time_limit": max(study.time_limit, 600.0)}
    record = result.controller_record()
    with tempfile.TemporaryDirectory() as folder:
        export(record, folder, real=real, figures=False)
        with Emulated(build(folder, core), mpc) as emulated:
            episode = fly(study.plant, emulated, study.task, **settings)
            if episode.failure is not None:
                raise RunError(f"the episode with the emulated {core.name} failed: {episode.failure}")
            footprint = emulated.footprint
            emulated.run_random(record.random_samples(RANDOM_SAMPLES))
            worst = emulated.footprint
    here = fly(study.plant, mpc.controller(theta, real=real), study.task, **settings)
    difference = float(np.max(np.abs(episode.tension - here.tension) / mpc.input_scale))
    kept = {
        "core": core.name,
        "real": real,
        "difference": difference,
        "episode": asdict(footprint),
        "worst": asdict(worst),
    }
    (result.folder / f"microcontroller-{real}.json").write_text(json.dumps(kept, indent=2) + "\n")
    return ProcessorInTheLoop(core.name, real, episode, footprint, worst, difference)
