"""Spikes become light on a display, for Python."""

from __future__ import annotations

import os
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from cosim.spikes.viform import SpikeStream
from scenarios.python.finished import Run
from scenarios.python.running import run, source_file
from scenarios.python.streams import save_stream
from scenarios.python.words import in_python

__all__ = ["show"]


@in_python
def show(
    stream: SpikeStream | str | os.PathLike[str], *,
    out: str | os.PathLike[str] | None = None, device: str | None = None, resume: bool = False,
    progress: bool | None = None, **settings: Any,
) -> Run:  # fmt: skip
    """Shows a stream on a spike-continuous display, as `viform run playback` does.

    Args:
        stream: spikes in memory, an open stream, or a file of any format.
        out: folder to create, with spikes in memory beside it in OUT.zarr; runs/playback-N if None.
        device: number or part of the name of an OpenCL device, or "numba".
        resume: whether the interrupted run in `out` goes on, with the same arguments; a complete
            one is returned.
        progress: whether progress is shown on standard error; None for on a terminal and in a
            notebook.
        **settings: keys of the scenario, such as **{"display.drive": "hold"}.

    Returns:
        The run; its `images` are what a still and a pursuing eye see.

    Raises:
        InputError: the input cannot be used.
    """
    with TemporaryDirectory(prefix="viform-") as folder:
        if isinstance(stream, (str, os.PathLike)):
            path = Path(stream)
        else:
            path = source_file(out, folder, ".zarr", resume=resume)
            save_stream(stream, path)
        own = {"sensor.source": f"file:{path}"}
        return run(
            "playback", out=out, device=device, resume=resume, progress=progress, **(own | settings)
        )
