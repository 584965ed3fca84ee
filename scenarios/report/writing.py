"""Which page a run's report is."""

from __future__ import annotations

from scenarios.report.glass import write_glass_report
from scenarios.report.page import write_page_report
from scenarios.run import Finished

__all__ = ["write_report"]


def write_report(run: Finished) -> list[str]:
    """Writes figures and report.html into the run's folder; their names."""
    return write_page_report(run) if run.shown is None else write_glass_report(run)
