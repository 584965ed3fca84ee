"""Choice of hardware: reads a budget, evaluates every choice, and ranks the choices."""

from scenarios.studies.design.document import budget_document, load_budget, to_budget

__all__ = ["budget_document", "load_budget", "to_budget"]
