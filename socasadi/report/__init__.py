"""Figures and animations of a run; it only draws."""

from ._animation import animate
from ._figures import figures, save_figures
from ._reach import reach_figure

__all__ = ["animate", "figures", "reach_figure", "save_figures"]
