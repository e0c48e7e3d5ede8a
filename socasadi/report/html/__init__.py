"""A run as one HTML file that opens from disk: what was found, and the rod moving in three dimensions.

``_pieces`` collects what the folder holds and says what it lacks, ``_data`` turns it into plain data for the page,
and ``page.html``, ``page.css`` and ``page.js`` show that with Plotly, which is written into the file.
"""

from ._page import Report, html_report, write_report

__all__ = ["Report", "html_report", "write_report"]
