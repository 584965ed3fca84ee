"""Number of cores, and work on all of them.

Compiled functions work on rows that threads of ours share out, and not on threads of numba: several
threads may call them, a forked process as well, and their compilation takes a third of the time.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from itertools import pairwise
from typing import Any, Final, TypeVar

from cosim.compute.cgroup import cores_in_groups

_Given = TypeVar("_Given")
_LEAST: Final = 1 << 13
"""Values that one thread is through with before another has begun."""
_limit = cache(cores_in_groups)


def cores() -> int:
    """Number of cores that this process may use: those of the machine, or fewer where the user
    (`taskset`), a container or a batch system says so."""
    if hasattr(os, "sched_getaffinity"):
        count = len(os.sched_getaffinity(0))
    else:
        count = os.cpu_count() or 1
    return min(count, _limit() or count)


def _threads() -> int:
    """Number of threads for rows: one for each core, or fewer where the user or the parent of a
    worker says so, in the variables of numba and OpenMP."""
    wanted = (os.environ.get(name, "") for name in ("NUMBA_NUM_THREADS", "OMP_NUM_THREADS"))
    return min([cores(), *(int(n) for n in wanted if n.isdecimal() and int(n))])


if cores() < (os.cpu_count() or 1):  # PoCL takes a thread for each core of the machine
    os.environ.setdefault("POCL_MAX_PTHREAD_COUNT", str(cores()))


@cache
def _rows() -> ThreadPoolExecutor:
    """A thread for each core."""
    return ThreadPoolExecutor(cores(), "rows")


@cache
def _beside() -> ThreadPoolExecutor:
    """A thread for each core but that of the caller."""
    return ThreadPoolExecutor(max(cores() - 1, 1), "beside")


if hasattr(os, "register_at_fork"):  # a fork does not copy threads
    os.register_at_fork(after_in_child=_rows.cache_clear)
    os.register_at_fork(after_in_child=_beside.cache_clear)


def by_rows(function: Callable[..., None], rows: int, *arguments: Any, least: int = _LEAST) -> None:
    """Calls function(first, stop, *arguments) for all rows, on all cores, or at once where there is
    little to do. The rows must be independent, and the function compiled without the interpreter
    lock (nogil=True).

    Args:
        function: compiled function.
        rows: number of rows.
        arguments: further arguments; the largest array says how much there is to do.
        least: values from which threads are worth it.
    """
    if arguments and max(getattr(each, "size", 1) for each in arguments) <= least:
        function(0, rows, *arguments)
        return
    count = _threads()
    edges = sorted({rows * k // count for k in range(count + 1)})
    jobs = [_rows().submit(function, a, b, *arguments) for a, b in pairwise(edges)]
    for job in jobs:
        job.result()


def beside(work: Callable[[], _Given]) -> Callable[[], _Given]:
    """Begins work in another thread, if a core is left for it.

    Returns:
        What waits for the work, and gives what it gave or raises what it raised. What has not begun
        by then is done there.
    """
    if cores() == 1:
        return work
    begun = _beside().submit(work)
    return lambda: work() if begun.cancel() else begun.result()
