"""Choice of hardware: reads a budget, evaluates every choice, and ranks the choices."""

from scenarios.studies.design.budget import load_budget, to_budget
from scenarios.studies.design.document import budget_document

__all__ = ["budget_document", "load_budget", "to_budget"]
