"""The report of a run: one HTML file, no network, pictures first."""

from scenarios.report.frame import write_report

__all__ = ["write_report"]
