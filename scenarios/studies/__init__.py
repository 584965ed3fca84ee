"""Studies over many runs: benchmarks, comparisons, the papers' numbers, stability."""
