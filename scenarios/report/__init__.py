"""The report of a run: one HTML file without references to the network."""

from scenarios.report.frame import write_report

__all__ = ["write_report"]
