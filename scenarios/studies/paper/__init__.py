"""Every number that the five source documents print, beside what the simulation's code gives."""

from scenarios.studies.paper.document import DOCUMENTS, paper_rows
from scenarios.studies.paper.row import Row

__all__ = ["DOCUMENTS", "Row", "paper_rows"]
