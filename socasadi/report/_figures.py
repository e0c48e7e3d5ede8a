from pathlib import Path

import matplotlib
from matplotlib.figure import Figure

from ..campaign import Result, Trial
from ._convergence import convergence
from ._episode import inputs, path, responses, shapes
from ._style import SETTINGS, note_trial


def figures(result: Result, baseline: list[Trial] | None = None, trial: int | None = None) -> dict[str, Figure]:
    """The figures of a run by name: convergence, responses, path, inputs, shapes; the first alone where no record is.

    Parameters
    ----------
    baseline
        Trials of another search, to stand beside in ``convergence``.
    trial
        Number of the trial whose episode is drawn; the best one by default.
    """
    mpc = result.study.mpc
    with matplotlib.rc_context(SETTINGS):
        drawn: dict[str, Figure | None] = {"convergence": convergence(result.trials, result.kept, baseline)}
        if trial is None and not result.recorded(result.best.number):
            return {name: figure for name, figure in drawn.items() if figure is not None}
        number = result.best.number if trial is None else trial
        episode = result.episode(number)
        flown = {
            "responses": responses(episode, mpc.output_limits),
            "path": path(episode) if mpc.outputs == 2 else None,
            "inputs": inputs(episode, mpc.input_limits),
            "shapes": shapes(episode),
        }
        for figure in flown.values():
            if figure is not None:
                note_trial(figure, number)
        drawn |= flown
    return {name: figure for name, figure in drawn.items() if figure is not None}


def save_figures(drawn: dict[str, Figure], folder: str | Path) -> list[Path]:
    """Write each figure as PNG and PDF into ``folder``; returns the files."""
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    files = [folder / f"{name}.{kind}" for name in drawn for kind in ("png", "pdf")]
    with matplotlib.rc_context(SETTINGS):
        for file in files:
            drawn[file.stem].savefig(file)
    return files
