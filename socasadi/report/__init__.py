"""Figures of a run; it only draws."""

from ._figures import figures, save_figures
from ._reach import reach_figure

__all__ = ["figures", "reach_figure", "save_figures"]
