"""One look for all figures: column widths of journals, type that survives them, colours that survive printing."""

from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

MM = 1 / 25.4
COLUMN = 88 * MM
PAGE = 180 * MM

# Okabe and Ito's palette, told apart by the colour-blind; lightness falls along it, so in grey too with the dashes.
BLUE, ORANGE, GREEN, GREY, BLACK = "#0072B2", "#D55E00", "#009E73", "#7F7F7F", "#000000"
INPUT_COLOURS = (BLUE, ORANGE, GREEN, "#CC79A7", "#56B4E9", "#E69F00")
INPUT_DASHES = ("-", (0, (5, 1.5)), (0, (2, 1)), (0, (5, 1, 1, 1)), (0, (1, 1)), "-.")

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


def legend_above(axes: Axes, columns: int) -> None:
    """A legend over the axes, where it hides no curve."""
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=columns, handlelength=2.2, columnspacing=1.2)
