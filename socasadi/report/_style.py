"""One look for all figures: column widths of journals, type that survives them, colours that survive printing."""

from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

MM = 1 / 25.4
COLUMN = 88 * MM
PAGE = 180 * MM

# Okabe and Ito's palette, told apart by the colour-blind.
BLUE, ORANGE, GREY, BLACK = "#0072B2", "#D55E00", "#7F7F7F", "#000000"
# In grey, too: of the first three inputs, and of the others, each is much lighter than another. Short dashes would
# drown in the steps of an input.
INPUT_COLOURS = (BLUE, "#E69F00", BLACK, "#56B4E9", ORANGE, "#004B7A")
INPUT_DASHES = ("-", "-", "-", (0, (6, 2)), (0, (6, 2)), (0, (6, 2)))

SETTINGS: dict[Any, Any] = {
    "font.size": 8,
    "axes.labelsize": 8,
    "axes.titlesize": 8,
    "xtick.labelsize": 7,
    "ytick.labelsize": 7,
    "legend.fontsize": 7,
    "legend.frameon": False,
    "axes.linewidth": 0.6,
    "lines.linewidth": 1.0,
    "lines.markersize": 3.5,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "pdf.fonttype": 42,
    "savefig.dpi": 300,
    "figure.constrained_layout.use": True,
}


def page(width: float, height: float, rows: int = 1) -> tuple[Figure, list[Axes]]:
    """A figure of ``width`` by ``height`` inches with ``rows`` axes that share their horizontal axis."""
    figure = Figure(figsize=(width, height))
    axes = figure.subplots(rows, 1, sharex=True, squeeze=False)
    return figure, list(axes[:, 0])


def note_trial(figure: Figure, number: int) -> None:
    """Say in a corner of a figure which trial it shows."""
    figure.text(0.99, 0.012, f"trial {number}", ha="right", va="bottom", fontsize=6, color="#555555")


def legend_above(axes: Axes, columns: int) -> None:
    """A legend over the axes, where it hides no curve."""
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=columns, handlelength=2.2, columnspacing=1.2)
