"""The command's start, for `run_time_s`: read before anything heavy is imported."""

import time

__all__ = ["BEGAN"]

BEGAN = time.perf_counter()
"""time.perf_counter() at the command's start."""
