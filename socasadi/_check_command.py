"""The command that says whether a study can work, before any experiment."""

from pathlib import Path
from typing import Annotated

import typer

from ._terminal import StudyFile, out, print_check
from .campaign import Study, load_study, read_probe
from .feasibility import Check, check, read_spec_sheet

SpecSheet = Annotated[
    Path | None, typer.Option("--spec", metavar="FILE", help="Data sheet (TOML) of a robot that is not simulated.")
]
RobotRecord = Annotated[
    Path | None, typer.Option("--record", metavar="FILE", help="Short probing record (CSV) of the robot itself.")
]


def check_(
    script: StudyFile,
    spec: SpecSheet = None,
    record: RobotRecord = None,
    figures: Annotated[
        Path | None,
        typer.Option("--figures", metavar="DIR", help="Folder for the picture; runs/NAME-check by default."),
    ] = None,
) -> None:
    """Say whether a study can work at all: reach, effort, timing, noise, model, arithmetic. Moves nothing."""
    study = load_study(script)
    found = checked(study, spec, record)
    out.print(f"{script}, by what is known from {found.source}:")
    print_check(found.findings)
    out.print(_summary(found))
    if found.picture is not None:
        from .report import reach_figure, save_figures  # matplotlib takes its time

        folder = figures or Path("runs") / f"{script.stem}-check"
        out.print(f"picture: {save_figures({'reach': reach_figure(found.picture)}, folder)[0]}")
    if found.verdict == "infeasible":
        raise typer.Exit(1)


def checked(study: Study, spec: Path | None, record: Path | None) -> Check:
    """The check of a study, with the data sheet and the record of a robot that is not simulated."""
    plant = None if spec is None else read_spec_sheet(spec, study.mpc.sample_time)
    probed = None if record is None else read_probe(record, study)
    return check(study, plant=plant, record=probed)


def _summary(found: Check) -> str:
    named = {
        verdict: ", ".join(finding.name for finding in found.findings if finding.verdict == verdict)
        for verdict in ("infeasible", "doubtful", "unknown")
    }
    told = [f"{verdict}: {names}" for verdict, names in named.items() if names]
    return "; ".join(told) if told else "nothing stands against it"
