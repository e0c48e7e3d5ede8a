"""Methods beside each other: the same robots, tasks and seeds, at equal cost, judged alike."""

from ._cell import fly_cell
from ._comparison import Comparison, Size
from ._judge import Elsewhere, Worth, worth, worth_elsewhere
from ._kept import stored_cells
from ._others import DeadCable, Delayed, Loaded, Misrouted, Noisier, Rubbing, Softer
from ._run import fitting_cells, load_comparison, run_comparison
from ._summary import Summary, summary_table

__all__ = [
    "Comparison",
    "DeadCable",
    "Delayed",
    "Elsewhere",
    "Loaded",
    "Misrouted",
    "Noisier",
    "Rubbing",
    "Size",
    "Softer",
    "Summary",
    "Worth",
    "fitting_cells",
    "fly_cell",
    "load_comparison",
    "run_comparison",
    "stored_cells",
    "summary_table",
    "worth",
    "worth_elsewhere",
]
