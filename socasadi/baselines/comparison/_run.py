"""All cells of a comparison, flown side by side and kept in a folder."""

import json
from collections import Counter
from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, wait
from pathlib import Path
from typing import Any

from ...campaign import load_script
from ...campaign.store import RunError
from ._cell import fly_cell
from ._check import check_elsewhere
from ._comparison import Comparison, Size
from ._kept import store_cell, stored_cells

_LOSSES = 2
"""Times that a cell is flown again when its worker has died."""


def load_comparison(script: str | Path, size: Size = "full") -> Comparison:
    """The ``comparison`` that a script defines, in a size.

    Raises
    ------
    RunError
        There is no such file, it breaks off (the message says where), or it defines no comparison.
    """
    found = load_script(Path(script)).get("comparison")
    if not isinstance(found, Comparison):
        raise RunError(f"{script} defines no `comparison`: let it make one, comparison = Comparison(study=..., ...)")
    return found.of_size(size)


def order_cell(script: str, size: Size, task: str, method: str, seed: int) -> str:
    """:func:`fly_cell` in another process, which runs the script again; JSON."""
    return json.dumps(fly_cell(load_comparison(script, size), task, method, seed))


def fitting_cells(comparison: Comparison, folder: str | Path) -> list[dict[str, Any]]:
    """The cells in a folder that were flown under the settings of a comparison; of several alike the last."""
    known = {(cell["task"], cell["method"], cell["seed"], cell["digest"]): cell for cell in stored_cells(folder)}
    keys = [(*names, comparison.digest(*names)) for names in comparison.cells]
    return [known[key] for key in keys if key in known]


def run_comparison(
    script: str | Path,
    size: Size,
    folder: str | Path,
    executor: Executor,
    progress: Callable[[dict[str, Any], int, int], None] = lambda cell, done, total: None,
    *,
    tasks: Sequence[str] = (),
    methods: Sequence[str] = (),
    seeds: int | None = None,
) -> list[dict[str, Any]]:
    """Fly all cells that ``folder`` does not hold yet, each stored when it is done; return them all.

    One that broke off is flown again.

    Parameters
    ----------
    executor
        Where they are flown: it is sent names and answers by text.
    progress
        Is told each cell that is done, how many are, and of how many.
    tasks, methods, seeds
        As of :meth:`Comparison.of_parts`.

    Raises
    ------
    RunError
        Another robot cannot be made, no worker can fly a cell, or they die of one; what was done is stored.
    """
    script, folder = Path(script), Path(folder)
    comparison = load_comparison(script, size).of_parts(tasks, methods, seeds)
    digests = {names: comparison.digest(*names) for names in comparison.cells}  # of the script as it is now
    folder.mkdir(parents=True, exist_ok=True)  # what cannot be kept is not worth flying
    cells = [cell for cell in fitting_cells(comparison, folder) if not cell["broke"]]
    known = {(cell["task"], cell["method"], cell["seed"]) for cell in cells}
    missing = [names for names in comparison.cells if names not in known]
    if missing:  # rather before the first flight than after it
        try:
            check_elsewhere(comparison)
        except ValueError as error:
            raise RunError(str(error)) from error
    total, losses = len(comparison.cells), Counter()
    waiting: dict[Future, tuple[str, str, int]] = {}
    gone: list[BrokenExecutor] = []

    def send(names: tuple[str, str, int]) -> None:
        if not gone:
            try:
                waiting[executor.submit(order_cell, str(script.resolve()), size, *names)] = names
            except BrokenExecutor as error:
                gone.append(error)

    try:
        for names in missing:
            send(names)
        while waiting:
            for future in wait(waiting, return_when=FIRST_COMPLETED).done:
                names = waiting.pop(future)
                name = ", ".join(map(str, names))
                try:
                    cell = json.loads(future.result())
                except BrokenExecutor as error:  # its worker died, of this cell or of something else
                    losses[names] += 1
                    if losses[names] > _LOSSES:
                        raise RunError(f"{name}: its workers die ({error})") from error
                    send(names)
                except ModuleNotFoundError as error:
                    raise RunError(
                        f"{name}: {error}. Install it, or leave the method out; what was done is stored"
                    ) from error
                except Exception as error:
                    raise RunError(f"{name}: {error}") from error
                else:
                    if cell["digest"] != digests[names]:
                        raise RunError(
                            f"{name}: {script.name}, or what it imports, was edited while it was flown, or a worker is "
                            "older: give the command again, after a restart of workers of your own"
                        )
                    store_cell(folder, cell)
                    cells.append(cell)
                    progress(cell, len(cells), total)
    finally:
        for future in waiting:
            future.cancel()
    if gone:
        raise RunError(f"nobody takes more cells ({gone[0]}); what was done is stored: give the command again")
    return cells
