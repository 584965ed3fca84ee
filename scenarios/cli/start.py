"""The start time of the command, for `run_time_s`: read before other modules are imported."""

import time

__all__ = ["BEGAN"]

BEGAN = time.perf_counter()
"""time.perf_counter() at the start of the command."""
