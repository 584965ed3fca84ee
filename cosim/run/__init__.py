"""Running: blocks through a chain of stages, result records, progress, the run's folder."""
