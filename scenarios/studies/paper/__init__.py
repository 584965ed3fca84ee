"""Compares every number in the five source documents with the simulation."""

from scenarios.studies.paper.document import DOCUMENTS, paper_rows

__all__ = ["DOCUMENTS", "paper_rows"]
