"""Runs the jobs of a batch: in this process, or on workers."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any

from cosim import InputError
from cosim.compute.pocl_files import keep_sums
from cosim.files.whole import NO_ROOM
from cosim.run.workers import workers_for

Job = tuple[int, tuple[Any, ...]]
Result = tuple[int, Any]


def run_jobs(
    job: Callable[..., Any], jobs: Sequence[Job], workers: int, scheduler: str | None
) -> Iterator[Result]:
    """Yields (number, what `job` returned, or the InputError that it raised) of each job, in the
    order in which they end.

    Args:
        job: a function of a module.
        jobs: number and arguments of each job.
        workers, scheduler: see `workers_for`.

    Raises:
        InputError: the scheduler does not answer.
        OSError: the disk is full, which is no fault of one job.
    """
    with workers_for(workers, scheduler) as pool:
        yield from pool.run(_run, {number: (job, given) for number, given in jobs})


def _run(job: Callable[..., Any], arguments: tuple[Any, ...]) -> Any:
    try:
        return job(*arguments)
    except InputError as exc:
        cause = exc.__cause__
        if isinstance(cause, OSError) and cause.errno in NO_ROOM:
            raise OSError(cause.errno, cause.strerror, cause.filename) from exc
        return exc
    finally:
        keep_sums()  # a worker is killed when its tasks are done
