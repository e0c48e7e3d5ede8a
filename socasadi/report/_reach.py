import matplotlib
import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Polygon, Rectangle

from ..feasibility import Picture
from ._style import BLACK, BLUE, COLUMN, GREY, MM, ORANGE, SETTINGS, legend_above, page


def reach_figure(picture: Picture) -> Figure:
    """Where the robot can be held, beside the reference and the output bounds, in the plane of two outputs."""
    with matplotlib.rc_context(SETTINGS):
        figure, (axes,) = page(COLUMN, 96 * MM)
        factor, unit = picture.shown
        axes.add_patch(Polygon(factor * picture.reach, fc="#DCE9F3", ec=BLUE, lw=1.0, label="can be held", zorder=1))
        if picture.pulling is not None:
            pulled = {"fill": False, "ec": BLUE, "ls": (0, (2, 1.5)), "label": "by cables that only pull"}
            axes.add_patch(Polygon(factor * picture.pulling, lw=0.9, zorder=2, **pulled))
        if picture.bounds is not None and np.isfinite(picture.bounds).all():
            low, high = (factor * side for side in picture.bounds)
            around = {"fill": False, "ec": ORANGE, "ls": "-.", "lw": 1.0, "label": "output bounds"}
            axes.add_patch(Rectangle((low[0], low[1]), high[0] - low[0], high[1] - low[1], **around))
        wanted, start, rest = factor * picture.reference, factor * picture.start, factor * picture.rest
        if np.ptp(wanted, axis=0).max() > 0:
            axes.plot(*wanted.T, color=BLACK, ls="--", lw=1.1, label="reference", zorder=4)
        else:
            axes.plot(*wanted[0], "+", color=BLACK, ms=9, label="reference", zorder=4)
        if not np.allclose(start, rest):
            axes.plot(*start, "s", mfc="white", mec=ORANGE, label="start", zorder=5)
        axes.plot(*rest, "o", color=GREY, label="rest", zorder=5)
        axes.set_aspect("equal", adjustable="datalim")
        axes.margins(0.08)
        axes.autoscale_view()
        axes.set_xlabel(f"y / {unit}")
        axes.set_ylabel(f"z / {unit}")
        legend_above(axes, 3)
    return figure
