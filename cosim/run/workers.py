"""Tasks on worker processes of this machine, or on those of any Dask scheduler."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any, Final, Protocol

from cosim.errors import InputError
from cosim.run.processes import RETRIES, Processes

MOST_WORKERS: Final = 1024
"""Largest number of processes."""
_SECONDS: Final = 10
"""Longest wait for a scheduler."""


class Workers(Protocol):
    """Processes that run tasks.

    Attributes:
        count: number of workers, at the start.
    """

    @property
    def count(self) -> int: ...

    def run(
        self, function: Callable[..., Any], tasks: Mapping[int, tuple[Any, ...]]
    ) -> Iterator[tuple[int, Any]]:
        """Yields (key, result) of each task, in the order in which they end.

        Args:
            function: function of a module that the workers can import.
            tasks: its arguments by key. They and the results can be pickled.
        """
        ...


class _Here:
    """This process, for one task after another."""

    count = 1

    def run(
        self, function: Callable[..., Any], tasks: Mapping[int, tuple[Any, ...]]
    ) -> Iterator[tuple[int, Any]]:
        for key, given in tasks.items():
            yield key, function(*given)


class _Dask:
    """The workers of a Dask scheduler. A task of a lost worker is run again."""

    def __init__(self, client: Any) -> None:
        self._client = client
        self.count = max(1, len(client.scheduler_info(n_workers=-1)["workers"]))

    def run(
        self, function: Callable[..., Any], tasks: Mapping[int, tuple[Any, ...]]
    ) -> Iterator[tuple[int, Any]]:
        from distributed import CancelledError, KilledWorker, as_completed

        keys = {
            self._client.submit(function, *given, pure=False, retries=RETRIES): key
            for key, given in tasks.items()
        }
        try:
            for future in as_completed(keys):
                yield keys[future], future.result()
                future.release()  # its result may be large
        except CancelledError:
            raise InputError(
                "--scheduler", "a Dask scheduler that runs until the end", "one that has ended",
                "start it and its workers again, and repeat the command with --out and --resume",
            ) from None  # fmt: skip
        except KilledWorker as exc:
            raise InputError(
                "--scheduler", "one whose workers have the memory for a task",
                f"one of which {exc.allowed_failures + 1} ended with the same task",
                "give them more memory, or make the input smaller",
            ) from None  # fmt: skip
        finally:
            self._client.cancel(list(keys))


def check_workers(workers: int | None) -> None:
    """Raises InputError for a number of processes that is none."""
    if workers is not None and not 1 <= workers <= MOST_WORKERS:
        raise InputError(
            "--workers",
            f"1 to {MOST_WORKERS}",
            f"{workers}",
            f"write {1 if workers < 1 else MOST_WORKERS}",
        )


@contextmanager
def workers_for(workers: int, scheduler: str | None) -> Iterator[Workers]:
    """The workers of a command.

    Args:
        workers: processes on this machine; with 1, tasks run in this one.
        scheduler: address of a Dask scheduler, whose workers are used instead; None for none.

    Raises:
        InputError: the scheduler does not answer.
    """
    if scheduler is None:
        if workers == 1:
            yield _Here()
        else:
            with Processes(workers) as processes:
                yield processes
        return
    import dask
    from distributed import Client

    for name in ("distributed", "distributed.client"):
        logging.getLogger(name).setLevel(logging.CRITICAL)  # what a user must know is raised
    dask.config.set({"distributed.scheduler.allowed-failures": RETRIES})
    try:
        client = Client(scheduler, timeout=_SECONDS)
    except Exception as exc:  # Dask's, of many types
        why = "no address"
        if isinstance(exc, (OSError, TimeoutError)):
            why = f"no answer within {_SECONDS} s"
        elif isinstance(exc, TypeError) and scheduler.startswith("tls://"):
            why = "no certificate: distributed.comm.tls of Dask's configuration names none"
        raise InputError(
            "--scheduler", "the address of a Dask scheduler that answers, such as "
            "tcp://host:8786", f"{scheduler} ({why})",
            "start `dask scheduler` there, or leave it out for workers here",
        ) from None  # fmt: skip
    with client:
        yield _Dask(client)
