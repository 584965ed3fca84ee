"""Runs the points of a sweep: in this process, or on the workers of Dask."""

from __future__ import annotations

import logging
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, Final

from cosim import InputError
from scenarios.assemble.schema.scenario import AnyScenario
from scenarios.studies.sweep.point import run_point

if TYPE_CHECKING:
    from distributed import Client

__all__ = ["run_points"]

_SECONDS: Final = 10
"""Longest wait for a scheduler."""
_RETRIES: Final = 3
"""Times that a point is run again after a worker was lost."""
Result = tuple[int, dict[str, Any] | InputError]


def run_points(
    name: str, scenarios: Sequence[tuple[int, AnyScenario]], device: str | None, workers: int,
    scheduler: str | None,
) -> Iterator[Result]:  # fmt: skip
    """Yields (number, document, or the error of its input) of each point, in the order in which
    they end.

    Args:
        name: short name of the scenario.
        scenarios: number and scenario of each point.
        device: of the points.
        workers: processes on this machine; with 1, points run in this one.
        scheduler: address of a Dask scheduler, whose workers are used instead; None for none.

    Raises:
        InputError: the scheduler does not answer.
    """
    if scheduler is None and workers == 1:
        for number, scenario in scenarios:
            yield number, _run(name, scenario, device)
        return
    with _client(workers, scheduler) as client:
        yield from _on_dask(client, name, scenarios, device)


def _run(name: str, scenario: AnyScenario, device: str | None) -> dict[str, Any] | InputError:
    try:
        return run_point(name, scenario, device)
    except InputError as exc:
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


def _on_dask(
    client: Client, name: str, scenarios: Sequence[tuple[int, AnyScenario]], device: str | None
) -> Iterator[Result]:
    from distributed import as_completed

    numbers = {
        client.submit(_run, name, scenario, device, pure=False, retries=_RETRIES): number
        for number, scenario in scenarios
    }
    try:
        for future in as_completed(numbers):
            yield numbers[future], future.result()
    finally:
        client.cancel(list(numbers))
