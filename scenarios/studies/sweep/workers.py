"""Runs the points of a sweep: in this process, or on workers."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from cosim import InputError
from cosim.run.workers import workers_for
from scenarios.assemble.schema.scenario import AnyScenario
from scenarios.studies.sweep.point import run_point

__all__ = ["run_points"]

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
        workers, scheduler: see `workers_for`.

    Raises:
        InputError: the scheduler does not answer.
    """
    with workers_for(workers, scheduler) as pool:
        yield from pool.run(_run, {number: (name, each, device) for number, each in scenarios})


def _run(name: str, scenario: AnyScenario, device: str | None) -> dict[str, Any] | InputError:
    try:
        return run_point(name, scenario, device)
    except InputError as exc:
        return exc
