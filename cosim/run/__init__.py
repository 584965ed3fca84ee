"""The run: chains of stages, results, progress, and the folder of a run."""
