"""Runs the jobs of a batch: in this process, or on the workers of Dask."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, Final

from cosim import InputError
from cosim.files.whole import NO_ROOM

if TYPE_CHECKING:
    from distributed import Client

__all__ = ["run_jobs"]

_SECONDS: Final = 10
"""Longest wait for a scheduler."""
_RETRIES: Final = 3
"""Times that a job is run again after a worker was lost."""
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
        workers: processes on this machine; with 1, jobs run in this one.
        scheduler: address of a Dask scheduler, whose workers are used instead; None for none.

    Raises:
        InputError: the scheduler does not answer.
        OSError: the disk is full, which is no fault of one job.
    """
    if scheduler is None and workers == 1:
        for number, arguments in jobs:
            yield number, _run(job, arguments)
        return
    with _client(workers, scheduler) as client:
        yield from _on_dask(client, job, jobs)


def _run(job: Callable[..., Any], arguments: tuple[Any, ...]) -> Any:
    try:
        return job(*arguments)
    except InputError as exc:
        cause = exc.__cause__
        if isinstance(cause, OSError) and cause.errno in NO_ROOM:
            raise OSError(cause.errno, cause.strerror, cause.filename) from exc
        return exc


@contextmanager
def _client(workers: int, scheduler: str | None) -> Iterator[Client]:
    import dask
    from distributed import Client, LocalCluster

    logging.getLogger("distributed").setLevel(logging.ERROR)  # it warns of workers that it ends
    dask.config.set({"distributed.scheduler.allowed-failures": _RETRIES})
    if scheduler is None:
        with (
            LocalCluster(
                n_workers=workers, threads_per_worker=1, processes=True, dashboard_address=None
            ) as cluster,
            Client(cluster) as client,
        ):
            yield client
        return
    try:
        client = Client(scheduler, timeout=_SECONDS)
    except (OSError, ValueError, TimeoutError) as exc:
        raise InputError(
            "--scheduler", "the address of a Dask scheduler that answers, such as "
            "tcp://host:8786", f"{scheduler} ({type(exc).__name__})",
            "start `dask scheduler` there, or leave it out for workers here",
        ) from None  # fmt: skip
    with client:
        yield client


def _on_dask(client: Client, job: Callable[..., Any], jobs: Sequence[Job]) -> Iterator[Result]:
    from distributed import as_completed

    numbers = {
        client.submit(_run, job, arguments, pure=False, retries=_RETRIES): number
        for number, arguments in jobs
    }
    try:
        for future in as_completed(numbers):
            yield numbers[future], future.result()
    finally:
        client.cancel(list(numbers))
