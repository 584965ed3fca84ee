"""Effects, the planner, tiles, patches, the paired check, and the ladder of tolerances."""
