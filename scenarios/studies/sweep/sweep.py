"""A sweep: points, their results in a folder, and what is left to do.

`sweep.json` states the sweep and is written first; `points/NNNNNN.json` is the result of a point.
`sweep.zarr` and the figure are written last, from the points.

One point of a sweep: a run without report, of which the result remains.
"""

from __future__ import annotations

import hashlib
import json
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from shutil import rmtree
from tempfile import TemporaryDirectory
from typing import Any

from cosim import InputError, Interrupted
from cosim.config.toml import to_toml
from cosim.files import NOT_KEPT
from cosim.run.folder import how_to_resume, room_for
from cosim.run.inputs import add_digests
from cosim.run.machine import NO_REPORT, Options
from cosim.run.progress import Progress, QuietProgress
from cosim.run.result import dumps
from scenarios.assemble.schema.loading import load
from scenarios.assemble.schema.scenario import AnyScenario
from scenarios.assemble.source.recording.opening import refuse_pipe
from scenarios.run import run_scenario
from scenarios.studies.batch.axes import Axis, check_axes, grid, latin_hypercube
from scenarios.studies.batch.jobs import begin_batch, read_document, run_jobs, write_document
from scenarios.studies.sweep.figure import chosen, sweep_figure
from scenarios.studies.sweep.store import metric_values, write_store


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


@dataclass(frozen=True)
class Sweep:
    """A sweep.

    Attributes:
        scenario: name of a scenario or a TOML file.
        axes: what varies.
        assignments: assignments of --set.
        samples: points of a Latin hypercube; None for all combinations.
        tolerance, seed: tolerance and seed of each point; those of the scenario if None.
    """

    scenario: str
    axes: tuple[Axis, ...]
    assignments: tuple[str, ...] = ()
    samples: int | None = None
    tolerance: float | None = None
    seed: int | None = None

    def __post_init__(self) -> None:
        if not self.axes:
            raise InputError("--vary", "given once or more", "never", "name a key and its values")
        check_axes(self.axes, self.assignments)

    def points(self) -> list[tuple[str, ...]]:
        """Values of the axes at each point."""
        if self.samples is None:
            return grid(self.axes)
        return latin_hypercube(self.axes, self.samples, 1 if self.seed is None else self.seed)

    def scenarios(self, points: Sequence[tuple[str, ...]]) -> tuple[str, list[AnyScenario]]:
        """Short name, and the checked scenario of each point. Raises InputError."""
        name, found = "", []
        for values in points:
            varied = [f"{axis.key}={value}" for axis, value in zip(self.axes, values, strict=True)]
            name, scenario = load(
                self.scenario, [*self.assignments, *varied], tolerance=self.tolerance,
                seed=self.seed,
            )  # fmt: skip
            refuse_pipe(scenario, "sweep, whose points all read it")
            found.append(scenario)
        return name, found


def _identity(scenario: AnyScenario) -> str:
    """Digest of a scenario and of the files that it names."""
    return hashlib.sha256(add_digests(to_toml(scenario)).encode()).hexdigest()


def run_sweep(
    sweep: Sweep, folder: Path, *, device: str | None, workers: int, scheduler: str | None,
    resume: bool, progress: Progress, metrics: Sequence[str] = (),
) -> dict[str, Any]:  # fmt: skip
    """Runs the points that have no result yet.

    Args:
        sweep: the sweep.
        folder: folder to create, or with `resume` that of an interrupted sweep.
        device: device of the points.
        workers, scheduler: see `run_jobs`.
        resume: whether an interrupted sweep goes on.
        progress: progress of the points.
        metrics: metrics in the figure; those that vary most if empty.

    Returns:
        The document of the sweep: its axes, and the rows of its points.

    Raises:
        InputError: a point cannot be loaded, before anything is written; or the folder is in use.
        Interrupted: by the user; `--resume` goes on.
    """
    points = sweep.points()
    name, scenarios = sweep.scenarios(points)
    digests = [_identity(each) for each in scenarios]
    stated = {
        "scenario": name,
        "axes": [{"key": axis.key, "values": list(axis.texts)} for axis in sweep.axes],
        "samples": sweep.samples,
        "points": [
            {"values": list(values), "digest": digest}
            for values, digest in zip(points, digests, strict=True)
        ],
    }
    begin_batch("sweep", folder, stated, "points", resume)
    place = folder / "points"
    jobs = [
        (n, (name, each, device))
        for n, each in enumerate(scenarios)
        if not _path(place, n).exists()
    ]
    progress.start(f"{name}: {len(points)} points", len(points))
    done = len(points) - len(jobs)
    progress.advance(done)
    failed: dict[int, InputError] = {}
    try:
        with room_for("the results", folder):
            for number, result in run_jobs(run_point, jobs, workers, scheduler):
                done += 1
                if not isinstance(result, InputError):
                    chosen(metric_values([result]), metrics)  # refuses unknown names
                if isinstance(result, InputError):
                    failed[number] = result
                    progress.note(f"point {number} ({', '.join(points[number])}): {result}")
                else:
                    write_document(_path(place, number), result)
                progress.advance(done)
    except InputError:
        if not any(place.iterdir()):  # no worker, or a wrong name: nothing stays
            rmtree(folder)
        raise
    except (KeyboardInterrupt, Interrupted):  # between points, or within one
        raise Interrupted(done, len(points), how_to_resume(folder), "points") from None
    rows = [
        read_document(_path(place, n), "sweep") if n not in failed else None
        for n in range(len(points))
    ]
    write_store(folder / "sweep.zarr", sweep.axes, sweep.samples, points, rows)
    drawn = sweep_figure(folder / "sweep.png", sweep.axes, points, rows, metrics)
    return {
        "scenario": name, "folder": str(folder), "keys": [axis.key for axis in sweep.axes],
        "figure": drawn, "failed": len(failed),
        "rows": [
            {"values": list(values), "result": row}
            for values, row in zip(points, rows, strict=True)
        ],
    }  # fmt: skip


def _path(place: Path, number: int) -> Path:
    return place / f"{number:06}.json"
