"""Figures of a run; it only draws."""

from ._figures import figures, save_figures

__all__ = ["figures", "save_figures"]
