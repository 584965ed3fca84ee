"""Scenarios and scenes, the command line, reports and benchmarks: where the parts meet."""
