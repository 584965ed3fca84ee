"""Compiled functions that use all cores may be called by several threads.

numba's own thread pool, which it takes where the machine has no OpenMP, ends the process if two
threads enter it at once: with it such functions run one at a time. With another pool they run at
once, so that one takes the cores that the other leaves.

OpenMP reads its settings when numba first enters it. By default its threads wait for work in a busy
loop: between the blocks of a run they would take the cores from OpenCL and from all other stages.
"""

from __future__ import annotations

import os
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import cache, wraps
from itertools import pairwise
from typing import Any, Final, TypeVar

from cosim.compute.cgroup import cores_in_groups
from cosim.compute.forks import use
from cosim.errors import InputError

_Function = TypeVar("_Function", bound=Callable[..., Any])
_Given = TypeVar("_Given")
_BUSY = threading.RLock()
_LEAST: Final = 1 << 13
"""Values that one thread is through with before another has begun."""
_SAFE: Final = ("omp", "tbb")
"""numba's thread pools that several threads may enter at once."""

os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")
_limit = cache(cores_in_groups)


def cores() -> int:
    """Number of cores that this process may use: those of the machine, or fewer where the user
    (`taskset`), a container or a batch system says so."""
    if hasattr(os, "sched_getaffinity"):
        count = len(os.sched_getaffinity(0))
    else:
        count = os.cpu_count() or 1
    return min(count, _limit() or count)


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
    lock. With numba's own threads (parallel=True), its compilation takes three times as long.

    Args:
        function: compiled function.
        rows: number of rows.
        arguments: further arguments; the largest array says how much there is to do.
        least: values from which threads are worth it.
    """
    if arguments and max(getattr(each, "size", 1) for each in arguments) <= least:
        function(0, rows, *arguments)
        return
    count = cores()
    edges = [rows * k // count for k in range(count + 1)]
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


def _shared() -> bool:
    """Whether several threads may enter numba's thread pool. It is not known before the first."""
    import numba  # takes half a second, and its functions are there when this is called

    try:
        return numba.threading_layer() in _SAFE
    except ValueError:
        return False


def all_cores(function: _Function) -> _Function:
    """Decorator, above `njit(parallel=True)`, of a function that threads may call. It raises
    InputError in a process that was forked from one that has called such a function, and if the
    user has set a thread pool that the machine lacks."""

    @wraps(function)
    def alone(*given: Any) -> Any:
        use("numba")
        try:
            if _shared():
                return function(*given)
            with _BUSY:
                return function(*given)
        except ValueError as exc:
            if not str(exc).startswith("No threading layer could be loaded"):
                raise
            layer = os.environ.get("NUMBA_THREADING_LAYER", "")
            raise InputError(
                "NUMBA_THREADING_LAYER", "a thread pool of numba that this machine has",
                repr(layer), "unset it",
            ) from None  # fmt: skip

    return alone  # type: ignore[return-value]  # the same signature
