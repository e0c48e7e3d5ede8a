"""Where a controller comes from, in lines for the header of its C."""

import json
import textwrap
from typing import TYPE_CHECKING

import numpy as np

from .store import describe

if TYPE_CHECKING:
    from ._study import Study


def provenance(study: "Study", theta: np.ndarray) -> tuple[str, ...]:
    """theta by name, and every setting of the study that says what the controller is for."""
    mpc = study.mpc
    entries = zip(mpc.entries, theta, strict=True)
    return (
        f"prediction model {type(mpc.model).__name__}, theta:",
        *[f"    {entry.name} = {float(value)!r} {entry.unit.removesuffix('1')}".rstrip() for entry, value in entries],
        *_told("MPC", mpc.at(theta)),
        *_told("task", study.task),
        *_told("cost", study.cost),
        f"search {study.search}, seed {study.seed}",
    )


def _told(title: str, part: object) -> list[str]:
    """Every setting of a part of a study but its model."""
    settings = {name: value for name, value in describe(part).items() if name != "model"}
    kind = settings.pop("type").rpartition(".")[2]
    told = ", ".join(f"{name} = {json.dumps(value)}" for name, value in settings.items())
    return textwrap.wrap(f"{title} {kind}: {told}", 110, subsequent_indent="    ", break_long_words=False)
