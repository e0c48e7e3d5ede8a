"""All cells of a comparison, flown side by side and kept in a folder."""

import json
import os
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, wait
from pathlib import Path
from typing import Any

from ...campaign import load_script
from ...campaign.store import RunError
from ._cell import fly_cell
from ._comparison import Comparison, Size

_LOSSES = 2
"""Times that a cell is flown again when its worker has died."""


def load_comparison(script: Path, size: Size = "full") -> Comparison:
    """The ``comparison`` that a script defines, in a size.

    Raises
    ------
    RunError
        There is no such file, it breaks off (the message says where), or it defines no comparison.
    """
    found = load_script(script).get("comparison")
    if not isinstance(found, Comparison):
        raise RunError(f"{script} defines no `comparison`: let it make one, comparison = Comparison(study=..., ...)")
    return found.of_size(size)


def order_cell(script: str, size: Size, task: str, method: str, seed: int) -> str:
    """:func:`fly_cell` in another process, which runs the script again; JSON."""
    key = script, size
    if key not in _loaded:
        _loaded[key] = load_comparison(Path(script), size)
    return json.dumps(fly_cell(_loaded[key], task, method, seed))


_loaded: dict[tuple[str, str], Comparison] = {}


def run_comparison(
    script: Path,
    size: Size,
    folder: Path,
    executor: Executor,
    progress: Callable[[dict[str, Any], int, int], None] = lambda cell, done, total: None,
    *,
    tasks: Sequence[str] = (),
    methods: Sequence[str] = (),
) -> list[dict[str, Any]]:
    """Fly all cells that ``folder`` does not hold yet, each stored when it is done; return them all.

    Parameters
    ----------
    executor
        Where they are flown: it is sent names and answers by text.
    progress
        Is told each cell that is done, how many are, and of how many.
    tasks, methods
        Names of those that are flown; none is all.

    Raises
    ------
    RunError
        No worker can fly a cell, or they die of one; what was done is stored.
    """
    comparison = load_comparison(script, size).of_parts(tasks, methods)
    known = {(c["task"], c["method"], c["seed"]): c for c in stored_cells(folder)}
    cells: list[dict[str, Any]] = []
    missing = []
    for task, method, seed in comparison.cells:
        cell = known.get((task, method, seed))
        if cell is not None and cell["digest"] == comparison.digest(task, method, seed):
            cells.append(cell)
        else:
            missing.append((task, method, seed))
    total, losses = len(comparison.cells), Counter()
    waiting: dict[Future, tuple[str, str, int]] = {}

    def send(names: tuple[str, str, int]) -> None:
        waiting[executor.submit(order_cell, str(script.resolve()), size, *names)] = names

    try:
        for names in missing:
            send(names)
        while waiting:
            for future in wait(waiting, return_when=FIRST_COMPLETED).done:
                names = waiting.pop(future)
                try:
                    cell = json.loads(future.result())
                except BrokenExecutor as error:  # its worker died, of this cell or of something else
                    losses[names] += 1
                    if losses[names] > _LOSSES:
                        raise RunError(f"{', '.join(map(str, names))}: its workers die ({error})") from error
                    send(names)
                except Exception as error:
                    raise RunError(f"{', '.join(map(str, names))}: {error}") from error
                else:
                    _store(folder, cell)
                    cells.append(cell)
                    progress(cell, len(cells), total)
    finally:
        for future in waiting:
            future.cancel()
    return cells


def stored_cells(folder: Path) -> Iterator[dict[str, Any]]:
    """The cells that a folder holds; what is no cell is left out."""
    for file in sorted(folder.glob("*/*.json")):
        try:
            cell = json.loads(file.read_text(encoding="utf-8"))
        except (OSError, ValueError):
            continue
        if isinstance(cell, dict) and "digest" in cell:
            yield cell


def _store(folder: Path, cell: dict[str, Any]) -> None:
    name = "".join(c if c.isalnum() else "-" for c in cell["method"])
    file = folder / cell["task"].replace(" ", "-") / f"{name}-{cell['seed']}.json"
    file.parent.mkdir(parents=True, exist_ok=True)
    part = file.with_name(f"{file.name}.part")
    part.write_text(json.dumps(cell), encoding="utf-8")
    os.replace(part, file)
