"""`viform.dataset`: a data set, for Python."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from cosim.run.folder import output_folder
from cosim.run.shown import progress_in_python
from cosim.run.workers import check_workers
from scenarios.assemble.schema.settings import assignments_of
from scenarios.studies.batch.axes import read_axis
from scenarios.studies.dataset.build import build_dataset
from scenarios.studies.dataset.inputs import read_cameras, read_sources
from scenarios.studies.dataset.order import CHECK, Order, read_split


def order_of(
    sources: Sequence[str], cameras: Sequence[str], vary: Sequence[str],
    assignments: Sequence[str], samples: int, split: str, seed: int | None,
    tolerance: float | None, check: int = CHECK,
) -> Order:  # fmt: skip
    """An order by the texts of the command line. Raises InputError."""
    return Order(
        tuple(read_sources(sources)), tuple(read_cameras(cameras)), tuple(map(read_axis, vary)),
        tuple(assignments), samples, read_split(split), 1 if seed is None else seed, tolerance,
        check,
    )  # fmt: skip


def dataset(
    *sources: str | os.PathLike[str], out: str | os.PathLike[str],
    cameras: Sequence[str | os.PathLike[str]] = (), vary: Mapping[str, str] | None = None,
    samples: int = 1, split: str = ".8,.1,.1", seed: int = 1, tolerance: float | None = None,
    check: int = CHECK,
    device: str | None = None, workers: int = 1, scheduler: str | None = None,
    resume: bool = False, progress: bool | None = None, **settings: Any,
) -> dict[str, Any]:  # fmt: skip
    """Films sources with cameras as `viform dataset` does: the same files.

    Args:
        sources: scenarios, TOML files, clips, or folders of clips.
        out: folder to create.
        cameras: chip presets, or TOML files with a [sensor]; that of each scenario if empty.
        vary: ranges by key, such as {"scene.illuminance": "200:2000 lux:log"}.
        samples: scenes of each source.
        split: shares of train, val and test.
        seed: seed of all that is drawn.
        tolerance: allowed relative error of each item.
        check: an item of so many is measured against full physics; 0 for none.
        device: number or part of the name of an OpenCL device, or "numba".
        workers: processes on this machine; a script needs no main guard for them.
        scheduler: address of a Dask scheduler, whose workers film instead; they must see `out`.
        resume: whether the interrupted data set in `out` goes on.
        progress: whether progress is shown on standard error; None for on a terminal and in a
            notebook.
        **settings: keys of the scenarios.

    Returns:
        The document of `viform dataset --json`.

    Raises:
        InputError: the input cannot be used.
    """
    check_workers(workers)
    asked = order_of(
        [os.fspath(each) for each in sources], [os.fspath(each) for each in cameras],
        [f"{key}={values}" for key, values in (vary or {}).items()], assignments_of(settings),
        samples, split, seed, tolerance, check,
    )  # fmt: skip
    folder = output_folder("dataset", Path(out), resume)
    with progress_in_python(progress) as shown:
        return build_dataset(
            asked, folder, device=device, workers=workers, scheduler=scheduler, resume=resume,
            progress=shown,
        )  # fmt: skip
