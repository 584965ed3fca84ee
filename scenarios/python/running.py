"""Runs of scenarios, for Python."""

from __future__ import annotations

import os
import time
from pathlib import Path
from typing import Any

from cosim import InputError
from cosim.run.folder import output_folder
from cosim.run.machine import REPORTS, Options
from cosim.run.shown import progress_in_python
from scenarios.assemble.machine import check_options
from scenarios.assemble.resuming import done_before
from scenarios.assemble.schema.loading import load
from scenarios.assemble.schema.settings import assignments_of
from scenarios.python.finished import Run
from scenarios.python.words import in_python
from scenarios.run import run_scenario


def source_file(
    out: str | os.PathLike[str] | None, folder: str, ending: str, *, resume: bool
) -> Path:  # fmt: skip
    """Place of a source that is in memory: OUT with this ending, beside the folder of the run, so
    that it can be repeated; in the temporary `folder` without `out`. Raises InputError if OUT is
    in use by a run that is not resumed, or absent for one that is."""
    if out is None:
        if resume:
            raise InputError("resume", "given with out", "alone", "add out and the folder")
        return Path(folder) / f"source{ending}"
    output_folder("run", Path(out), resume=resume)
    Path(out).parent.mkdir(parents=True, exist_ok=True)
    return Path(f"{os.fspath(out).rstrip('/')}{ending}")


def joined(own: dict[str, Any], settings: dict[str, Any]) -> dict[str, Any]:
    """The keys of a scenario: those of arguments, and those that are given by name. Raises
    InputError for one that is given twice."""
    for key in own.keys() & settings.keys():
        raise InputError(
            key, "given once", "as a key and as an argument of its own", "leave the key out"
        )
    return own | settings


def refuse_of_run(resume: bool, report: str) -> None:
    """Raises InputError for what only a call with `out` can have."""
    for name, given in (("resume", resume), ("report", report != REPORTS[0])):
        if given:
            raise InputError(name, "given with out", "alone", "add out and the folder")


@in_python
def run(
    scenario: str | os.PathLike[str] = "glass", *, out: str | os.PathLike[str] | None = None,
    tolerance: float | None = None, seed: int | None = None, device: str | None = None,
    store: str = "fast", resume: bool = False, workers: int | None = None,
    scheduler: str | None = None, report: str = "page", progress: bool | None = None,
    **settings: Any,
) -> Run:  # fmt: skip
    """Runs a scenario as `viform run` does: the same bits, files and report.

    Args:
        scenario: a name of `viform list`, a TOML file, or the folder of a run.
        out: folder to create; runs/SCENARIO-N if None.
        tolerance: allowed relative error; that of the scenario if None.
        seed: seed of all temporal noise; that of the scenario if None.
        device: number or part of the name of an OpenCL device, or "numba"; the default if None.
        store: how streams are compressed: raw, fast, small, or none for not at all.
        resume: whether the interrupted run in `out` goes on; a complete one is returned.
        workers: processes that simulate the rows of a latched chip in bands; None for none. A
            script that gives more than 1 starts with `if __name__ == "__main__":`.
        scheduler: address of a Dask scheduler, whose workers do so.
        report: page, or none: no images, figures and page, only the result and the streams.
        progress: whether progress is shown on standard error; None for on a terminal and in a
            notebook.
        **settings: keys of the scenario, such as **{"scene.path": "clip.mp4", "duration": "64 ms"}.

    Raises:
        InputError: the input cannot be used.
    """
    began = time.perf_counter()
    name, loaded = load(str(scenario), assignments_of(settings), tolerance=tolerance, seed=seed)
    options = Options(device, resume, None, store, workers, scheduler, report)
    check_options(loaded, options)
    if resume and out is not None and done_before(name, loaded, Path(out)) is not None:
        return Run(Path(out))
    with progress_in_python(progress) as shown:
        done = run_scenario(
            name, loaded, None if out is None else Path(out), options=options, progress=shown,
            began=began,
        )  # fmt: skip
    return Run(done.folder, tuple(shown.notes))
