"""Every number that the five source documents print, beside what the simulation's code gives."""

from scenarios.studies.paper.document import DOCUMENTS, paper_rows

__all__ = ["DOCUMENTS", "paper_rows"]
