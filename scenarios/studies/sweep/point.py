"""One point of a sweep: a run without report, of which the result remains."""

from __future__ import annotations

import json
import time
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from cosim.files import NOT_KEPT
from cosim.run.machine import NO_REPORT, Options
from cosim.run.progress import QuietProgress
from cosim.run.result import dumps
from scenarios.assemble.schema.scenario import AnyScenario
from scenarios.run import run_scenario


def run_point(name: str, scenario: AnyScenario, device: str | None) -> dict[str, Any]:
    """Document of the result, as `viform run --json` prints it.

    Args:
        name: short name of the scenario.
        scenario: checked scenario.
        device: number or part of the name of an OpenCL device, "numba", or None for the default.

    Raises:
        InputError: the machine of the worker cannot run it.
    """
    with TemporaryDirectory(prefix="viform-point-") as folder:
        done = run_scenario(
            name, scenario, Path(folder) / "run",
            options=Options(device, store=NOT_KEPT, report=NO_REPORT),
            progress=QuietProgress(), began=time.perf_counter(),
        )  # fmt: skip
        document: dict[str, Any] = json.loads(dumps(done.result.document()))
    return document
