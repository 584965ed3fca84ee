"""Effects, the planner, tiles, and the order of error against tolerance."""
