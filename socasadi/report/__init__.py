"""Figures, animations and the page of a run, and the look that they share, for figures of one's own; it only draws."""

from ._animation import animate
from ._comparison import comparison_figures
from ._convergence import best_so_far, cost_axis
from ._figures import figures, save_figures
from ._reach import reach_figure
from ._style import BLACK, BLUE, COLUMN, GREY, MM, ORANGE, SETTINGS, legend_above, page
from .html import Report, html_report, write_report

__all__ = [
    "BLACK",
    "BLUE",
    "COLUMN",
    "GREY",
    "MM",
    "ORANGE",
    "SETTINGS",
    "Report",
    "animate",
    "best_so_far",
    "comparison_figures",
    "cost_axis",
    "figures",
    "html_report",
    "legend_above",
    "page",
    "reach_figure",
    "save_figures",
    "write_report",
]
