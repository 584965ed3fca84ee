"""Effects, the planner, tiles, patches, the paired trial, and the ladder of tolerances."""
