"""Results of a sweep as one labelled Zarr store, which `xarray.open_zarr` reads."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import zarr

from scenarios.studies.batch.axes import Axis

Row = dict[str, Any] | None


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
