"""The cells of a comparison in a folder, a line of JSON each: a stop costs none that was done."""

import json
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any


def stored_cells(folder: str | Path) -> Iterator[dict[str, Any]]:
    """The cells that a folder holds, in the order in which they were done; what is no cell is left out."""
    try:
        lines = _file(Path(folder)).read_text(encoding="utf-8", errors="replace").splitlines()
    except FileNotFoundError:
        return
    for line in lines:
        try:
            cell = json.loads(line)
        except ValueError:
            continue
        if isinstance(cell, dict) and "digest" in cell:
            yield cell


def store_cell(folder: Path, cell: dict[str, Any]) -> None:
    """Add a cell, in one write, so that two comparisons may share a folder."""
    with _file(folder).open("ab+") as file:
        line = json.dumps(cell).encode() + b"\n"
        if end := file.tell():
            file.seek(end - 1)
            if file.read(1) != b"\n":  # the last write was cut off
                line = b"\n" + line
        file.write(line)
        file.flush()
        os.fsync(file.fileno())


def _file(folder: Path) -> Path:
    return folder / "cells.jsonl"
