"""The functions of Python that run a scenario: any (`run`), a display that shows spikes (`show`),
and a link that sends bytes (`send`), in memory or as a run in a folder."""

from __future__ import annotations

import os
import time
from functools import lru_cache
from pathlib import Path
from typing import Any, overload

from cosim import InputError
from cosim.run.folder import output_folder
from cosim.run.inputs import FILE
from cosim.run.machine import REPORTS, Options
from cosim.run.shown import progress_in_python
from cosim.spikes.viform import SpikeStream
from link.core import Crossed
from link.setting import read_payload
from scenarios.assemble.called import shown_in_memory
from scenarios.assemble.machine import check_options
from scenarios.assemble.resuming import done_before
from scenarios.assemble.schema.loading import assignments_of, load
from scenarios.python.display import Display, Seen
from scenarios.python.errors import in_python
from scenarios.python.finished import Run
from scenarios.python.link import Link
from scenarios.python.streams import as_stream, save_stream
from scenarios.run import run_scenario

Data = bytes | bytearray | memoryview | str | os.PathLike[str]
"""Bytes, or the path of a file that has them."""


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
    """The keys of a scenario: those of arguments, and those that are given by name, of which None
    is not given. Raises InputError for one that is given twice."""
    settings = {key: value for key, value in settings.items() if value is not None}
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


@lru_cache(maxsize=1)  # the next call is likely to have the same settings
def _display(assignments: tuple[str, ...], device: str | None) -> Display:
    """The display of settings. Raises InputError."""
    _, scenario = load("playback", [f"sensor.source={FILE}memory", *assignments])
    shown = shown_in_memory(scenario)
    if shown is None:
        raise InputError(
            "out", "given for what a display in memory has not: a link, a camera, a board, or a "
            "live stream", "None", "add out and the folder of a run",
        )  # fmt: skip
    return Display.of(shown, device)


@overload
def show(
    stream: SpikeStream | str | os.PathLike[str], *, out: None = None, device: str | None = None,
    resume: bool = False, report: str = "page", progress: bool | None = None, **settings: Any,
) -> Seen: ...  # fmt: skip


@overload
def show(
    stream: SpikeStream | str | os.PathLike[str], *, out: str | os.PathLike[str],
    device: str | None = None, resume: bool = False, report: str = "page",
    progress: bool | None = None, **settings: Any,
) -> Run: ...  # fmt: skip


@in_python
def show(
    stream: SpikeStream | str | os.PathLike[str], *,
    out: str | os.PathLike[str] | None = None, device: str | None = None, resume: bool = False,
    report: str = "page", progress: bool | None = None, **settings: Any,
) -> Seen | Run:  # fmt: skip
    """Shows a stream on a spike-continuous display: the images of `viform run playback`. Without
    `out` they stay in memory, see `Display`.

    Args:
        stream: spikes in memory, an open stream, or a file of any format.
        out: folder to create, with figures and report, and spikes in memory beside it in OUT.zarr;
            none if None.
        device: number or part of the name of an OpenCL device, or "numba".
        resume: whether the interrupted run in `out` goes on, with the same arguments; a complete
            one is returned.
        report: what the run in `out` makes: page, or none for the result and the streams alone.
        progress: whether progress of a run is shown on standard error; None for on a terminal and
            in a notebook.
        **settings: keys of the scenario, such as **{"display.drive": "hold"}.

    Returns:
        What a still and a pursuing eye see; with `out`, the run.

    Raises:
        InputError: the input cannot be used.
    """
    path = Path(stream) if isinstance(stream, (str, os.PathLike)) else None
    if out is None:
        refuse_of_run(resume, report)
        display = _display(tuple(assignments_of(settings)), device)
        return display.shown(stream, display.eyes_of_a_run)
    given = joined({"sensor.source": f"{FILE}{path}"}, settings)
    if path is None:
        path = source_file(out, "", ".zarr", resume=resume)
        save_stream(as_stream(stream), path)
        given["sensor.source"] = f"{FILE}{path}"
    return run(
        "playback", out=out, device=device, resume=resume, report=report, progress=progress,
        **given,
    )  # fmt: skip


@overload
def send(
    data: Data, *, out: None = None, tolerance: float | None = None,
    seed: int | None = None, device: str | None = None, resume: bool = False,
    report: str = "page", progress: bool | None = None, **settings: Any,
) -> Crossed: ...  # fmt: skip
@overload
def send(
    data: Data, *, out: str | os.PathLike[str],
    tolerance: float | None = None, seed: int | None = None, device: str | None = None,
    resume: bool = False, report: str = "page", progress: bool | None = None, **settings: Any,
) -> Run: ...  # fmt: skip
@in_python
def send(
    data: Data, *, out: str | os.PathLike[str] | None = None,
    tolerance: float | None = None, seed: int | None = None, device: str | None = None,
    resume: bool = False, report: str = "page", progress: bool | None = None, **settings: Any,
) -> Crossed | Run:  # fmt: skip
    """Sends bytes from a panel to a spike camera, as `viform run light-link` does. Without `out`
    they stay in memory, see `Link`.

    Args:
        data: the bytes, one or more, or the path of a file.
        out: folder to create, with bytes beside it in OUT.bin; nothing is written if None.
        tolerance: allowed error, half-widths of the bit error rate's interval; that of the scenario
            if None.
        seed: seed of all random effects; that of the scenario if None.
        device: number or part of the name of an OpenCL device, or "numba".
        resume: whether the interrupted run in `out` goes on, with the same arguments; a complete
            one is returned.
        report: what the run in `out` makes: page, or none for the result and the streams alone.
        progress: whether progress is shown on standard error; None for on a terminal and in a
            notebook. Without `out`, none is shown.
        **settings: keys of the scenario, such as **{"link.distance": "4 m"}; without `out` those of
            [link] and [sensor].

    Returns:
        What arrived, as of `Link.send`; with `out` the run, whose `received` has it by name.

    Raises:
        InputError: the input cannot be used.
    """
    if isinstance(data, (bytearray, memoryview)):
        data = bytes(data)
    if not isinstance(data, (bytes, str, os.PathLike)):
        raise InputError("data", "bytes, or the path of a file", type(data).__name__, "convert it")
    if out is None:
        refuse_of_run(resume, report)
        payload = data if isinstance(data, bytes) else read_payload(Path(data)).data
        _check_bytes(len(payload), "none")
        with Link.of(settings, len(payload), tolerance, seed, device) as link:
            return link.send(payload)
    given = joined({"link.file": None}, settings)
    if isinstance(data, bytes):
        _check_bytes(len(data), "none")
        path = source_file(out, "", ".bin", resume=resume)
        path.write_bytes(data)
    else:
        path = Path(data)
        if path.is_file():
            _check_bytes(path.stat().st_size, f"the empty file {path}")
    given["link.file"] = path
    return run(
        "light-link", out=out, tolerance=tolerance, seed=seed, device=device, resume=resume,
        report=report, progress=progress, **given,
    )  # fmt: skip


def _check_bytes(size: int, given: str) -> None:
    """Raises InputError for nothing to send: the search for a mode and the lock of the clock, a
    minute or more, would have no use."""
    if size == 0:
        raise InputError("data", "one byte or more", given, "give bytes, or the path of a file")
