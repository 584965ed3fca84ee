"""The start of the command, before other modules are imported: its time, for `run_time_s`, and
settings of the interpreter and of the C library that suit short runs with large arrays."""

import ctypes
import gc
import os
import time
from contextlib import suppress

__all__ = ["BEGAN"]

BEGAN = time.perf_counter()
"""time.perf_counter() at the start of the command."""

_M_TRIM_THRESHOLD, _M_MMAP_THRESHOLD, _M_ARENA_MAX = -1, -3, -8
"""Parameters of mallopt(3)."""

# By default, Python looks for dead cycles of objects after each 700 new ones. Imports make a
# million, almost none of them dead, and take an eighth longer for it.
gc.set_threshold(50_000)

# By default, the memory of an array of 4 MB goes back to the system when it is freed, and the next
# array takes it page by page: 2.6 ms, several times as long as the arithmetic on it.
with suppress(AttributeError, OSError):  # not the GNU C library
    _mallopt = ctypes.CDLL(None).mallopt
    _mallopt(_M_MMAP_THRESHOLD, 1 << 25)  # the largest that it takes
    _mallopt(_M_TRIM_THRESHOLD, 1 << 28)
    # By default, threads have pools of 64 MB, between which freed memory does not pass.
    _mallopt(_M_ARENA_MAX, 1)

# OpenBLAS reads this when numpy is imported. Its products here are small, and its threads wait for
# the next one in a busy loop, on the cores that kernels and compiled loops use.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
