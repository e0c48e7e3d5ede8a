import base64
import hashlib
import io
import json
import os
from dataclasses import dataclass
from datetime import datetime
from importlib.resources import files
from pathlib import Path
from typing import Any

import jinja2

from ...campaign import Study, Units, bound_notes, estimate_told, trial_row, verdict_row
from ...campaign.store import journal_path
from ...feasibility import Check
from ...plant import ExternalPlant
from .._reach import reach_figure
from ._data import page_data
from ._pieces import Pieces

_LARGEST = 7_800_000
"""Bytes of a page."""


@dataclass(frozen=True)
class Report:
    """A page that was written.

    Attributes
    ----------
    file
        Where.
    lacks
        What it says that it lacks, a line each.
    damaged
        Whether the run's settings or its journal are missing or damaged, and not only pieces that a run may lack.
    """

    file: Path
    lacks: tuple[str, ...]
    damaged: bool


def html_report(
    folder: str | Path, file: str | Path | None = None, study: Study | None = None, found: Check | None = None
) -> Path:
    """Write a run as one HTML file that needs nothing beside it, and no network; less than 8 MB.

    A piece of the run that is missing or damaged is named in the page, and the others are shown.

    Parameters
    ----------
    folder
        Of the run.
    file
        Where to write; ``report.html`` in the folder by default.
    study
        The study, where a part of it is of the user's own making, so that the folder cannot make it.
    found
        What was checked with more than the study knows of its robot; None: what is found by the study alone.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    FileNotFoundError
        There is no such folder.
    ValueError
        It holds neither settings nor trials: it is no run.
    """
    return write_report(folder, file, study, found).file


def write_report(
    folder: str | Path, file: str | Path | None = None, study: Study | None = None, found: Check | None = None
) -> Report:
    """Do as :func:`html_report`, and say what the page lacks."""
    from plotly.offline import get_plotlyjs  # takes its time

    folder = Path(folder)
    if not folder.is_dir():
        raise FileNotFoundError(f"there is no run folder {folder}")
    pieces = Pieces.gather(folder, study, found)
    if pieces.study is None and not pieces.trials:
        raise ValueError(f"{folder} holds no run that could be reported: {'; '.join(pieces.missing)}")
    own = files(__name__.rpartition(".")[0])
    parts = {name: own.joinpath(f"page.{name}").read_text(encoding="utf-8") for name in ("css", "js")}
    parts["plotly"] = get_plotlyjs()
    around = {**_told(pieces), "parts": parts}
    template = _environment().from_string(own.joinpath("page.html").read_text(encoding="utf-8"))
    frame = len(template.render(**around, missing=pieces.missing, data="").encode("utf-8"))
    data = json.dumps(page_data(pieces, _LARGEST - frame - 400 * len(pieces.trials) - 100_000), separators=(",", ":"))
    # A sign that would end the script element does not occur in JSON but within texts.
    page = template.render(**around, missing=pieces.missing, data=data.replace("<", "\\u003c"))
    file = Path(file) if file else folder / "report.html"
    if file.is_dir():
        raise ValueError(f"{file} is a folder; name a file in it, such as {file / 'report.html'}")
    file.parent.mkdir(parents=True, exist_ok=True)
    part = file.with_name(f"{file.name}.part")
    try:
        part.write_text(page, encoding="utf-8")
        os.replace(part, file)
    finally:
        part.unlink(missing_ok=True)
    return Report(file, tuple(pieces.missing), pieces.damaged)


def _environment() -> jinja2.Environment:
    return jinja2.Environment(autoescape=True, undefined=jinja2.StrictUndefined, trim_blocks=True, lstrip_blocks=True)


def _told(pieces: Pieces) -> dict[str, Any]:
    """What the page says without script."""
    study, trials, best = pieces.study, pieces.trials, pieces.best
    factor, unit = Units.of(study.plant).shown if study else (1e3, "mm")
    score = best.score if best else None
    tiles = []
    if best is not None:
        about = f"trial {best.number}"
        if pieces.chosen is not None and pieces.chosen.number != best.number:
            about += f"; exported: trial {pieces.chosen.number}, the best of those flown again"
        tiles.append(("best J observed", f"{best.J:.4g}", about))
    if pieces.estimate is not None:
        cost, sure = estimate_told(pieces.estimate, trials)
        tiles.append(("best J without noise, estimated", cost or "not known", sure))
    if score is not None:
        # Of a recording nothing but the measurements is known.
        outputs = "measured" if study and isinstance(study.plant, ExternalPlant) else "true"
        about = f"of the {outputs} outputs, in the best trial"
        tiles.append((f"RMSE after 5 s / {unit}", f"{factor * score.rmse:.3g}", about))
    failed = sum(trial.outcome == "failed" for trial in trials)
    cut = sum(trial.outcome == "cut" for trial in trials)
    told = f"{failed} failed, {cut} cut short"
    if study and study.trials != len(trials):
        told = (
            f"of {study.trials}, {pieces.pending} of them out; {told}"
            if pieces.pending
            else f"of {study.trials}; {told}"
        )
    tiles.append(("trials", str(len(trials)), told))
    if seconds := sum(trial.plant_seconds or 0.0 for trial in trials):
        tiles.append(("the robot moved for", f"{seconds / 60:.3g} min", "in the search"))
    return {
        "title": pieces.folder.resolve().name,
        "tiles": tiles,
        "findings": pieces.found.findings if pieces.found else (),
        "source": pieces.found.source if pieces.found else "",
        "reach": _reach(pieces),
        "trials": [trial_row(trial, study, best=trial is best) for trial in pieces.trials],
        "theta": _theta(pieces),
        "verdicts": [{"theta": name} | verdict_row(verdict, study) for name, verdict in pieces.verdicts.items()]
        if study
        else [],
        "limits": [f"{limit.name} {limit.limit:g} {limit.unit}".rstrip() for limit in study.limits] if study else [],
        "episodes": any(trial.plant_seconds for trial in trials),
        "unit": unit,
        "costs": pieces.costs,
        "settings": _settings(pieces),
        "provenance": _provenance(pieces),
        "outputs": study.mpc.outputs if study else 0,
        "slices": pieces.sensitivity is not None,
        "shape": pieces.rod_plant is not None,
    }


def _theta(pieces: Pieces) -> list[dict[str, str]]:
    if pieces.study is None or pieces.chosen is None:
        return []
    identified = pieces.verdicts.get("identified")
    found, rows, entries = pieces.sensitivity, [], pieces.study.mpc.entries
    notes = bound_notes(entries, pieces.chosen.theta)
    for i, entry in enumerate(entries):
        rows.append(
            {
                "name": entry.name,
                "unit": "" if entry.unit == "1" else entry.unit,
                "value": f"{pieces.chosen.theta[i]:.4g}",
                "bounds": f"{entry.lower:.4g} to {entry.upper:.4g}" + (f", {notes[i]}" if notes[i] else ""),
                "identified": f"{identified.theta[i]:.4g}" if identified else "",
                "likely": f"{found.likely[i, 0]:.3g} to {found.likely[i, 1]:.3g}" if found else "",
                "relevance": f"{100 * found.relevance[i]:.0f} %" if found else "",
                "share": f"{100 * found.relevance[i] / found.relevance.max():.0f}" if found else "0",
            }
        )
    return rows


def _reach(pieces: Pieces) -> str:
    """The picture of the check, as the source of an image; empty without one."""
    if pieces.found is None or pieces.found.picture is None:
        return ""
    drawn = io.BytesIO()
    reach_figure(pieces.found.picture).savefig(drawn, format="svg", metadata={"Date": None})
    return f"data:image/svg+xml;base64,{base64.b64encode(drawn.getvalue()).decode('ascii')}"


def _settings(pieces: Pieces) -> list[tuple[str, str]]:
    """The study's settings, part by part."""
    told = pieces.settings.get("settings", {})
    parts = {name: value for name, value in told.items() if isinstance(value, dict)}
    rest = {name: value for name, value in told.items() if name not in parts and name != "type"}
    texts = [("search", json.dumps(rest, indent=1))] if rest else []
    return texts + [(name, json.dumps(value, indent=1)) for name, value in parts.items()]


def _provenance(pieces: Pieces) -> list[tuple[str, str]]:
    lines = [("run folder", pieces.folder.resolve().name)]
    lines += [(name, version) for name, version in pieces.settings.get("versions", {}).items()]
    lines += [(name, str(pieces.settings[name])) for name in ("python", "machine") if name in pieces.settings]
    if pieces.study is not None:
        lines.append(("seed", str(pieces.study.seed)))
    if pieces.trials:
        lines.append(("first trial", pieces.trials[0].started))
        lines.append(("last trial", pieces.trials[-1].started))
    journal = journal_path(pieces.folder)
    if journal.is_file():
        lines.append(("sha256 of the journal", hashlib.sha256(journal.read_bytes()).hexdigest()))
    return [*lines, ("report written", datetime.now().astimezone().isoformat(timespec="seconds"))]
