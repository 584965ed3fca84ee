"""`viform design`: the best of a hardware budget."""
