"""`viform design`: choice of hardware within a budget."""
