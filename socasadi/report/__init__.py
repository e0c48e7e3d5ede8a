"""Figures and animations of a run; it only draws."""

from ._animation import animate
from ._figures import figures, save_figures

__all__ = ["animate", "figures", "save_figures"]
