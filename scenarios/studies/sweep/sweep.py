"""A sweep: its points, each a run without report, their results in a folder, what is left to do,
and the figure of metrics over the keys that vary.

`sweep.json` states the sweep and is written first; `points/NNNNNN.json` is the result of a point.
`sweep.zarr`, a labelled Zarr store that `xarray.open_zarr` reads, and the figure are written last,
from the points.
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
from typing import Any, Final

import numpy as np
import numpy.typing as npt
import zarr

from cosim import InputError, Interrupted
from cosim.config.toml import to_toml
from cosim.files import NOT_KEPT
from cosim.report.figures import INK, MARK, subplots
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

_SHOWN: Final = 4
"""Metrics of a figure that nobody chose."""
_ASKED_FOR: Final = ("psnr", "goodput_bps", "ber", "error")
"""Ends of the names of metrics that are drawn before others."""
_OF_THE_RUN: Final = ("run_time_s", "camera", "full_physics", "error_high")
"""Figures that are not drawn unasked."""
Row = dict[str, Any] | None


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


def chosen(values: dict[str, Any], metrics: Sequence[str]) -> list[str]:
    """Names of the metrics in the figure: those asked for, or those that vary most. Raises
    InputError for a name that no result has."""
    for name in metrics:
        if values and name not in values:
            raise InputError("--metric", f"one of {', '.join(values)}", name, "choose one")
    if metrics:
        return [name for name in metrics if name in values]
    spread = {
        name: float(np.nanstd(v) / (abs(np.nanmean(v)) or 1))
        for name, (v, _) in values.items()
        if name not in _OF_THE_RUN and np.isfinite(v).any()
    }
    varied = [name for name in spread if spread[name] > 0] or list(spread)
    varied.sort(key=lambda name: (not name.endswith(_ASKED_FOR), -spread[name]))
    return varied[:_SHOWN]


def sweep_figure(
    path: Path, axes: Sequence[Axis], points: Sequence[tuple[str, ...]], rows: Sequence[Row],
    metrics: Sequence[str] = (),
) -> list[str]:  # fmt: skip
    """Draws a panel for each metric: a line over one key, a map over two of a grid, else points
    over each key. Returns the names of the metrics.

    Raises:
        InputError: no such metric.
    """
    values = metric_values(rows)
    names = chosen(values, metrics)
    if not names:
        return []
    shape = [len(axis.texts) for axis in axes]
    whole = int(np.prod(shape)) == len(points)
    across = 1 if whole and len(axes) <= 2 else len(axes)
    figure, panels = subplots(
        len(names), across, figsize=(1.5 + 4.2 * across, 3.2 * len(names)), layout="constrained",
        squeeze=False,
    )  # fmt: skip
    for line, name in zip(panels, names, strict=True):
        level, unit = values[name]
        label = name if unit == "1" else f"{name} ({unit})"
        if whole and len(axes) == 2:
            _map(figure, line[0], axes, level.reshape(shape), label)
            continue
        for n, (panel, axis) in enumerate(zip(line, axes, strict=False)):
            at, ticks = _places(axis, [point[n] for point in points])
            style = "o-" if whole and len(axes) == 1 else "o"
            panel.plot(at, level, style, color=MARK, markersize=4)
            panel.set_xlabel(axis.key + (f" ({axis.unit})" if axis.unit else ""))
            panel.set_ylabel(label)
            _scale(panel.xaxis, axis, ticks)
            panel.grid(alpha=0.3)
    figure.savefig(path, dpi=120, facecolor="white")
    return names


def _places(axis: Axis, texts: Sequence[str]) -> tuple[npt.NDArray[np.float64], list[str] | None]:
    """Places of values on an axis, and labels if they are no numbers."""
    numbers = Axis(axis.key, tuple(texts), axis.span, axis.unit).numbers
    if numbers is not None:
        return np.array(numbers), None
    known = list(axis.texts or dict.fromkeys(texts))
    return np.array([known.index(text) for text in texts], np.float64), known


def _scale(side: Any, axis: Axis, ticks: list[str] | None) -> None:
    if ticks is not None:
        side.set_ticks(range(len(ticks)), ticks)
    elif axis.log:
        side._set_axes_scale("log")


def _map(
    figure: Any, panel: Any, axes: Sequence[Axis], level: npt.NDArray[np.float64], label: str
) -> None:
    """A map over two keys, each value in a cell of its own."""
    image = panel.imshow(level, origin="lower", aspect="auto", cmap="viridis")
    for side, axis in ((panel.yaxis, axes[0]), (panel.xaxis, axes[1])):
        side.set_ticks(range(len(axis.texts)), axis.texts)
        side.set_label_text(axis.key, color=INK)
    panel.tick_params(axis="x", rotation=30)
    figure.colorbar(image, ax=panel, label=label)


def _identity(scenario: AnyScenario) -> str:
    """Digest of a scenario and of the files that it names."""
    return hashlib.sha256(add_digests(to_toml(scenario)).encode()).hexdigest()


def _path(place: Path, number: int) -> Path:
    return place / f"{number:06}.json"


def metric_values(rows: Sequence[Row]) -> dict[str, tuple[npt.NDArray[np.float64], str]]:
    """Values of each metric and its unit, (points,) float64, NaN where it is unknown. With them
    `error`, the measured error of the simulation, `error_high`, its limit, and `run_time_s`."""
    found: dict[str, tuple[npt.NDArray[np.float64], str]] = {}

    def put(name: str, number: int, value: float | None, unit: str) -> None:
        if name not in found:
            found[name] = np.full(len(rows), np.nan), unit
        if value is not None:
            found[name][0][number] = value

    for number, row in enumerate(rows):
        if row is None:
            continue
        error = row["error"]
        put("error", number, error["value"], "1")
        put("error_high", number, None if error["ci"] is None else error["ci"][1], "1")
        put("run_time_s", number, row["run_time_s"], "s")
        for name, metric in row["metrics"].items():
            put(name, number, metric["value"], metric["unit"])
    return found


def _labels(axis: Axis) -> tuple[npt.NDArray[Any], str]:
    """Numbers of an axis and their unit, or its texts."""
    numbers = axis.numbers
    if numbers is None:
        return np.array(axis.texts, np.dtypes.StringDType()), ""
    return np.array(numbers), axis.unit or axis.texts[0].lstrip("+-0123456789.eE").strip()


def write_store(
    path: Path, axes: Sequence[Axis], samples: int | None, points: Sequence[tuple[str, ...]],
    rows: Sequence[Row],
) -> None:  # fmt: skip
    """Writes the store, over an earlier one.

    Args:
        path: path of the store.
        axes: axes of the sweep. Each is a dimension of a grid; of a Latin hypercube the only
            dimension is `point`, and the axes are variables.
        samples: points of a Latin hypercube, None for a grid.
        points: values of the axes.
        rows: documents of the results, None for a failed point.
    """
    root = zarr.open_group(path, mode="w")

    def put(name: str, values: npt.NDArray[Any], dims: Sequence[str], unit: str) -> None:
        array = root.create_array(name, data=values, dimension_names=list(dims))
        if unit:
            array.attrs["units"] = unit

    if samples is None:
        dims, shape = [axis.key for axis in axes], [len(axis.texts) for axis in axes]
        for axis in axes:
            labels, unit = _labels(axis)
            put(axis.key, labels, [axis.key], unit)
    else:
        dims, shape = ["point"], [len(points)]
        put("point", np.arange(len(points)), dims, "")
        for n, axis in enumerate(axes):
            texts = tuple(values[n] for values in points)
            labels, unit = _labels(Axis(axis.key, texts, axis.span, axis.unit))
            put(axis.key, labels, dims, unit)
    for name, (values, unit) in metric_values(rows).items():
        put(name, values.reshape(shape), dims, unit)
