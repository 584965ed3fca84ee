"""Choosing hardware: a budget is read, every choice judged, the best named."""

from scenarios.studies.design.budget import BudgetFile, load_budget, to_budget
from scenarios.studies.design.document import budget_document

__all__ = ["BudgetFile", "budget_document", "load_budget", "to_budget"]
