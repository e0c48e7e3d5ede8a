"""Commands of a campaign whose trials are flown by hand or by another program: init, ask, tell."""

import json
import math
import shlex
import warnings
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from ._terminal import (
    Anyway,
    ProbeRecord,
    RunFolder,
    StudyFile,
    StudyScript,
    distance,
    opened,
    out,
    print_theta,
    starting_from,
    table,
)
from .campaign import (
    Asked,
    Bench,
    Campaign,
    Episode,
    Result,
    RunError,
    Study,
    Trial,
    load_study,
    read_recording,
    recognise,
    told_outcome,
)
from .codegen import c_compiler
from .export import ExportError
from .mpc import DesignError, check_real

_DOUBTFUL = 0.1
"""Share of the input bound from which on a recording's inputs are told to be far from its controller's."""


def init(
    script: StudyFile,
    folder: Annotated[Path | None, typer.Option("--out", help="Run folder; runs/NAME by default.")] = None,
    iterations: Annotated[int | None, typer.Option(help="Trials after the seed points.")] = None,
    seed: Annotated[int | None, typer.Option(help="Of the search.")] = None,
    real: Annotated[
        str | None, typer.Option(help="What the controller's C computes in: double (default) or float.")
    ] = None,
    record: ProbeRecord = None,
    anyway: Anyway = False,
    resume: Annotated[bool, typer.Option("--resume", help="Change the iterations of a run that is there.")] = False,
) -> None:
    """Make a run whose trials are flown by hand or by another program: ask and tell bring them."""
    if real is not None:
        check_real(real)
        _check_compiler(real)
    study = starting_from(load_study(script), record, anyway)
    changes = {"iterations": iterations, "seed": seed}
    study = replace(study, **{name: value for name, value in changes.items() if value is not None})
    folder = folder or Path("runs") / script.stem
    with Campaign(study, folder, resume=resume):
        bench = Bench.of(study, folder)
        if real is not None:
            bench = bench.computing_in(real)  # pyright: ignore[reportArgumentType] (checked above)
        bench.prepare()
    try:
        Result.open(folder)
        again = ""
    except RunError:  # ask and tell cannot make the study from its folder alone
        again = f" --study {shlex.quote(str(script))}"
    out.print(
        f"{folder}: {study.trials} trials of {study.task.duration:g} s\n"
        f"controller  {bench.sources}: the C that no trial changes, see its README.md\n"
        f"{_pulse(study)}"
        f"next        socasadi ask {_quoted(folder)}{again}"
    )


def ask(
    folder: RunFolder,
    count: Annotated[int, typer.Option(help="How many trials, for as many robots.")] = 1,
    as_json: Annotated[bool, typer.Option("--json", help="Print for a program: a list of trials.")] = False,
    pending: Annotated[bool, typer.Option("--pending", help="Only list what was asked and not told.")] = False,
    script: StudyScript = None,
) -> None:
    """Say what to try next: theta, and the controller's data header."""
    if count < 1:
        raise RunError(f"--count is at least 1, not {count}")
    if pending:
        result = opened(folder, script)
        _print_pending(result, as_json)
        return
    bench = Bench.of(opened(folder, script).study, folder)
    _check_compiler(bench.real)
    given: list[Asked] = []
    unsure: list[int] = []  # points of the search that were asked while more trials were out than told
    with _campaign(folder, script) as campaign:
        trials = campaign.study.trials
        while len(given) < count and len(campaign.trials) + len(campaign.pending) < trials:
            blind = len(campaign.pending) > len(campaign.trials)
            asked = campaign.ask()
            if blind and asked.phase == "search":
                unsure.append(asked.number)
            try:
                bench.lay_out(asked)
            except (DesignError, ExportError) as error:
                campaign.tell(asked.number, failed=f"{type(error).__name__}: {error}")
                if not as_json:
                    out.print(f"trial {asked.number} has failed without being flown: {error}\n")
            else:
                given.append(asked)
        if unsure:
            warnings.warn(
                f"asked in ignorance of the trials that are out, which are more than were told: {_numbers(unsure)}; "
                "tell those first where you can",
                stacklevel=1,
            )
        if not given:
            pending_now = f", {len(campaign.pending)} of them are out" if campaign.pending else ""
            raise RunError(
                f"all {trials} trials of {folder} were asked{pending_now}; for more: "
                f"socasadi init STUDY --out {_quoted(folder)} --resume --iterations N"
            )
    if as_json:
        print(json.dumps([bench.about(asked) for asked in given], indent=2))
        return
    for i, asked in enumerate(given):
        if i:
            out.print()
        _print_asked(bench, asked, trials)
    if len(given) < count:
        out.print(f"\nThese are all: the run has {trials} trials.")


def tell(
    folder: RunFolder,
    trial: Annotated[int, typer.Option(help="Number of the trial, as ask said it.")],
    recording: Annotated[Path | None, typer.Option("--csv", help="Recording of its experiment.")] = None,
    cost: Annotated[float | None, typer.Option(help="Its J, where that was measured elsewhere.")] = None,
    failed: Annotated[str | None, typer.Option(help="Why it gave no J.")] = None,
    measured: Annotated[
        list[str] | None, typer.Option(metavar="NAME=VALUE", help="With --cost: a value that the study limits.")
    ] = None,
    anyway: Annotated[
        bool, typer.Option("--anyway", help="Take a recording whose inputs are not the controller's.")
    ] = False,
    take_back: Annotated[
        bool, typer.Option("--take-back", help="Instead: what was told of it was wrong; it is out again.")
    ] = False,
    script: StudyScript = None,
) -> None:
    """Bring the result of a trial that was flown by hand or by another program, or take it back."""
    if sum(outcome is not None for outcome in (recording, cost, failed)) + take_back != 1:
        raise RunError("tell takes exactly one of --csv FILE, --cost J, --failed REASON and --take-back")
    if measured and cost is None:
        raise RunError("--measured goes with --cost; from a recording it is computed")
    if anyway and recording is None:
        raise RunError("--anyway goes with --csv: it takes a recording whose inputs are not the controller's")
    if cost is not None and not math.isfinite(cost):
        raise RunError(f"--cost takes a finite number, not {cost}; a trial that gave none is told by --failed REASON")
    if failed is not None and not failed.strip():
        raise RunError("--failed takes the reason, in a few words")
    values = _measured(measured or [])
    with _campaign(folder, script) as campaign:
        before = campaign.best
        if take_back:
            _print_taken_back(campaign, campaign.take_back(trial))
            return
        if recording is None:
            told = campaign.tell(trial, cost=cost, failed=failed, measured=values or None)
        else:
            told = campaign.tell(trial, episode=_recorded(campaign, trial, recording, anyway))
        _print_told(campaign, told, before)


def _recorded(campaign: Campaign, number: int, path: Path, anyway: bool) -> Episode:
    """The episode of a recording, which has to be of that trial."""
    asked = {asked.number: asked for asked in campaign.pending}.get(number)
    if asked is None:  # which the campaign refuses, whatever was recorded
        return read_recording(path, campaign.study)
    episode = read_recording(path, campaign.study, give_up=asked.give_up)
    thetas = {one.number: one.theta for one in (*campaign.pending, *campaign.trials)}
    share, other = recognise(number, episode, thetas, campaign.study)
    if other is not None:
        raise RunError(
            f"{path} holds the inputs of trial {other}'s controller, and not of trial {number}'s: tell it as trial "
            f"{other}, or fly trial {number} with the controller_data.h of its own"
        )
    if share > _DOUBTFUL and not anyway:
        raise RunError(
            f"trial {number}'s controller would have answered the outputs in {path} by other inputs: they differ by "
            f"{100 * share:.0f} % of the bound (root mean square), so another one flew, or a column is wrong; tell it "
            "with --anyway if you are sure"
        )
    return episode


def _campaign(folder: Path, script: Path | None) -> Campaign:
    study = opened(folder, script).study
    return Campaign.open(folder) if script is None else Campaign(study, folder, resume=True)


def _check_compiler(real: str) -> None:
    if real == "float" and c_compiler() is None:
        raise RunError("single precision is compared with double for each trial, and there is no C compiler to do it")


def _measured(given: list[str]) -> dict[str, float]:
    values = {}
    for text in given:
        name, _, value = text.partition("=")
        try:
            values[name.strip()] = float(value)
        except ValueError:
            raise RunError(f"--measured takes NAME=VALUE, such as overshoot=0.004, not {text!r}") from None
    return values


def _print_asked(bench: Bench, asked: Asked, trials: int) -> None:
    folder, mpc = bench.trial(asked.number), bench.study.mpc
    kind = "a seed point" if asked.phase == "seed" else "of the search"
    print_theta(bench.study, asked, f"trial {asked.number} of {trials}, {kind}:")
    columns = [f"{name} [{unit}]" if unit else name for name, unit in bench.columns.items()]
    seconds = bench.samples * mpc.sample_time
    lines = {
        "controller": f"{folder / 'controller_data.h'}, with the C in {bench.sources}",
        "recording": f"CSV of {bench.samples + 1} rows, t = 0 to {seconds:g} s every {mpc.sample_time:g} s: "
        f"{', '.join(columns)}",
        "next": f"fly it, then: socasadi tell {_quoted(bench.folder)} --trial {asked.number} --csv recording.csv",
        "": '(or --cost J, or --failed "what happened")',
    }
    if asked.give_up is not None:
        lines["may end"] = f"early, once its J is above {asked.give_up:.4g}: tell the recording until then"
    for name, told in lines.items():
        out.print(f"{name:11} {told}")
    out.print(_pulse(bench.study), end="")


def _pulse(study: Study) -> str:
    """A line of what disturbs the robot in each trial; nothing where nothing does."""
    pulse = study.task.pulse
    return f"disturbance {pulse.in_words}\n" if pulse else ""


def _print_pending(result: Result, as_json: bool) -> None:
    bench, out_now = Bench.of(result.study, result.folder), result.pending
    for asked in out_now:
        # An ask that was broken off may have left its trial without its files.
        if asked.by_hand and not (bench.trial(asked.number) / "controller_data.h").exists():
            bench.lay_out(asked)
    if as_json:
        print(json.dumps([bench.about(asked) for asked in out_now], indent=2))
        return
    if not out_now:
        out.print(f"{result.folder}: nothing is out; {_left(len(result.trials), 0, result.study)}")
        return
    rows = [
        {
            "trial": str(asked.number),
            "phase": asked.phase,
            "asked (UTC)": asked.started.split("+")[0].replace("T", " "),
            "controller": str(bench.trial(asked.number)) if asked.by_hand else "flown by a run",
        }
        for asked in out_now
    ]
    out.print(table(rows, left=("phase", "asked (UTC)", "controller")))


def _print_told(campaign: Campaign, told: Trial, before: Trial | None) -> None:
    study, score = campaign.study, told.score
    factor, unit = distance(study)
    line = told_outcome(told)
    if told.outcome == "cut":
        line += f"; {told.saved_seconds or 0:g} s were spared"
    if score is not None:
        line += f" (tracking {score.tracking:.4g}, input {score.effort:.4g}), RMSE {factor * score.rmse:.3f} {unit}"
    for limit in study.limits:
        if told.measured and limit.name in told.measured:
            value = told.measured[limit.name]
            verdict = "kept" if value <= limit.limit else f"NOT kept: at most {limit.limit:g}"
            line += f"\n            {limit.name} {value:.4g} {limit.unit}".rstrip() + f", {verdict}"
    out.print(f"{f'trial {told.number}':11} {line}")
    if (best := campaign.best) is not None:
        newly = ", as told now" if best.number == told.number else ""
        was = f" (before: {before.J:.5g}, trial {before.number})" if newly and before is not None else ""
        out.print(f"best        J = {best.J:.5g}, trial {best.number}{newly}{was}")
    out.print(f"run         {_left(len(campaign.trials), len(campaign.pending), study)}")
    folder, numbers = _quoted(campaign.folder), ", ".join(str(asked.number) for asked in campaign.pending)
    if campaign.complete:
        following = f"socasadi show {folder}, socasadi export {folder} --out DIR"
    elif len(campaign.trials) + len(campaign.pending) < study.trials:
        following = f"socasadi ask {folder}"
    else:
        following = f"nothing but to wait for trial {numbers}"
    out.print(f"next        {following}")


def _print_taken_back(campaign: Campaign, trial: Trial) -> None:
    folder = _quoted(campaign.folder)
    out.print(f"{f'trial {trial.number}':11} was told as {told_outcome(trial)}; that is taken back")
    out.print(f"run         {_left(len(campaign.trials), len(campaign.pending), campaign.study)}")
    following = f"socasadi tell {folder} --trial {trial.number} --csv recording.csv"
    out.print(f"next        {following if trial.by_hand else 'socasadi run STUDY --resume flies it again'}")


def _left(told: int, pending: int, study: Study) -> str:
    return f"{told} of {study.trials} trials told, {pending} out, {study.trials - told - pending} to be asked"


def _numbers(trials: list[int]) -> str:
    first, last = trials[0], trials[-1]
    return f"trial {first}" if first == last else f"trials {first} to {last}"


def _quoted(path: Path) -> str:
    return shlex.quote(str(path))
