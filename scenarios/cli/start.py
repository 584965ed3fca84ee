"""The start of the command, before other modules are imported: its time, for `run_time_s`."""

import gc
import time

__all__ = ["BEGAN"]

BEGAN = time.perf_counter()
"""time.perf_counter() at the start of the command."""

# By default, Python looks for dead cycles of objects after each 700 new ones. Imports make a
# million, almost none of them dead, and take an eighth longer for it.
gc.set_threshold(50_000)
