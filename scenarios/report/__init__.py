"""The report of a run: one HTML file, no network, pictures first."""

from scenarios.report.writing import write_report

__all__ = ["write_report"]
