"""Choosing hardware: a budget is read, every choice judged, the best named."""

from scenarios.studies.design.budget import load_budget, to_budget
from scenarios.studies.design.document import budget_document

__all__ = ["budget_document", "load_budget", "to_budget"]
