"""Spikes become light on a display, for Python."""

from __future__ import annotations

import os
from functools import lru_cache
from pathlib import Path
from typing import Any, overload

from cosim import InputError
from cosim.run.inputs import FILE
from cosim.spikes.viform import SpikeStream
from scenarios.assemble.called import shown_in_memory
from scenarios.assemble.schema.loading import load
from scenarios.assemble.schema.settings import assignments_of
from scenarios.python.display import Display, Seen
from scenarios.python.finished import Run
from scenarios.python.running import joined, refuse_of_run, run, source_file
from scenarios.python.streams import as_stream, save_stream
from scenarios.python.words import in_python


@lru_cache(maxsize=1)  # the next call is likely to have the same settings
def _display(assignments: tuple[str, ...], device: str | None) -> Display:
    """The display of settings. Raises InputError."""
    _, scenario = load("playback", [f"sensor.source={FILE}memory", *assignments])
    shown = shown_in_memory(scenario)
    if shown is None:
        raise InputError(
            "out", "given for what a display in memory has not: a link, a camera, a board, or a "
            "stream that comes", "None", "add out and the folder of a run",
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
