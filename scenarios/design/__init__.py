"""Choosing hardware: a budget is read, every choice judged, the best named."""

from scenarios.design.budget import BudgetFile, load_budget, to_budget
from scenarios.design.document import budget_document

__all__ = ["BudgetFile", "budget_document", "load_budget", "to_budget"]
