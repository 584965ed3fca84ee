"""A sweep: points, their results in a folder, and what is left to do.

`sweep.json` states the sweep and is written first; `points/NNNNNN.json` is the result of a point.
`sweep.zarr` and the figure are written last, from the points.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from shutil import rmtree
from typing import Any

from cosim import InputError, Interrupted
from cosim.files.whole import whole
from cosim.run.folder import how_to_resume, room_for
from cosim.run.progress import Progress
from cosim.run.result import dumps
from scenarios.assemble.schema.loading import load
from scenarios.assemble.schema.scenario import AnyScenario
from scenarios.studies.sweep.axes import Axis, grid, latin_hypercube
from scenarios.studies.sweep.figure import chosen, sweep_figure
from scenarios.studies.sweep.store import metric_values, write_store
from scenarios.studies.sweep.workers import run_points

__all__ = ["Sweep", "run_sweep"]

_STATED = "sweep.json"


@dataclass(frozen=True)
class Sweep:
    """A sweep.

    Attributes:
        scenario: name of a scenario or a TOML file.
        axes: what varies.
        assignments: of --set.
        samples: points of a Latin hypercube; None for all combinations.
        tolerance, seed: of each point; those of the scenario if None.
    """

    scenario: str
    axes: tuple[Axis, ...]
    assignments: tuple[str, ...] = ()
    samples: int | None = None
    tolerance: float | None = None
    seed: int | None = None

    def __post_init__(self) -> None:
        keys = [axis.key for axis in self.axes]
        if not keys:
            raise InputError("--vary", "given once or more", "never", "name a key and its values")
        for key in keys:
            if keys.count(key) > 1:
                raise InputError("--vary", "a key once", f"{key} twice", "leave one out")
            if any(text.partition("=")[0].strip() == key for text in self.assignments):
                raise InputError("--set", "a key that does not vary", key, "leave it out")

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
            found.append(scenario)
        return name, found


def _identity(scenario: AnyScenario) -> str:
    """Digest of a scenario."""
    return hashlib.sha256(scenario.model_dump_json().encode()).hexdigest()


def run_sweep(
    sweep: Sweep, folder: Path, *, device: str | None, workers: int, scheduler: str | None,
    resume: bool, progress: Progress, metrics: Sequence[str] = (),
) -> dict[str, Any]:  # fmt: skip
    """Runs the points that have no result yet.

    Args:
        sweep: the sweep.
        folder: to create, or with `resume` that of an interrupted sweep.
        device: of the points.
        workers, scheduler: see `run_points`.
        resume: whether an interrupted sweep goes on.
        progress: of the points.
        metrics: in the figure; those that vary most if empty.

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
    _begin(folder, stated, resume)
    place = folder / "points"
    left = [(n, each) for n, each in enumerate(scenarios) if not _path(place, n).exists()]
    progress.start(f"{name}: {len(points)} points", len(points))
    done = len(points) - len(left)
    progress.advance(done)
    failed: dict[int, InputError] = {}
    try:
        with room_for("the results", folder):
            for number, result in run_points(name, left, device, workers, scheduler):
                done += 1
                if not isinstance(result, InputError):
                    chosen(metric_values([result]), metrics)  # refuses unknown names
                if isinstance(result, InputError):
                    failed[number] = result
                    progress.note(f"point {number} ({', '.join(points[number])}): {result}")
                else:
                    with whole(_path(place, number)) as part:
                        part.write_text(dumps(result), encoding="utf-8")
                progress.advance(done)
    except InputError:
        if not any(place.iterdir()):  # no worker, or a wrong name: nothing stays
            rmtree(folder)
        raise
    except KeyboardInterrupt:
        raise Interrupted(done, len(points), how_to_resume(folder), "points") from None
    rows = [_read(_path(place, n)) if n not in failed else None for n in range(len(points))]
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


def _read(path: Path) -> Any:
    """A document of the sweep. Raises InputError if it is damaged."""
    try:
        return json.loads(path.read_bytes())
    except (OSError, ValueError) as exc:
        raise InputError(
            path.name, "the file that the sweep wrote", f"a damaged file ({path})",
            "remove it (of a point, to run that again), and resume",
        ) from exc  # fmt: skip


def _path(place: Path, number: int) -> Path:
    return place / f"{number:06}.json"


def _begin(folder: Path, stated: dict[str, Any], resume: bool) -> None:
    """Creates the folder, or checks that it holds this sweep."""
    there = folder / _STATED
    if resume and there.exists():
        if _read(there) != stated:
            raise InputError(
                "--resume", f"the sweep that {folder} holds", "another one",
                "give the same arguments, or another --out",
            )  # fmt: skip
        return
    if folder.is_dir() and any(folder.iterdir()):
        raise InputError(
            "--resume", "given with a sweep", f"{folder}, which is none", "change --out"
        )
    with room_for("the sweep", folder):
        (folder / "points").mkdir(parents=True, exist_ok=True)
        with whole(there) as part:
            part.write_text(dumps(stated), encoding="utf-8")
