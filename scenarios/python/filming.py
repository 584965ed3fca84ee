"""A scene, a clip or frames become spikes, for Python."""

from __future__ import annotations

import os
from collections.abc import Iterable
from numbers import Real
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy.typing as npt

from cosim import InputError, Viform
from cosim.spikes.viform import part_of
from scenarios.assemble.schema.loading import shipped
from scenarios.python.clips import write_clip
from scenarios.python.running import run, source_file
from scenarios.python.words import in_python

__all__ = ["film"]


@in_python
def film(
    source: str | os.PathLike[str] | Iterable[npt.ArrayLike] = "film", *,
    frame_rate: float | None = None, chip: str | None = None, tolerance: float | None = None,
    seed: int | None = None, device: str | None = None,
    out: str | os.PathLike[str] | None = None, resume: bool = False, progress: bool | None = None,
    **settings: Any,
) -> Viform:  # fmt: skip
    """Films a source with a spike camera: the bits of `viform run`.

    Args:
        source: a scenario of `viform list` or a TOML file; a clip or image; or frames, as an array
            (T, H, W), a list, or a generator, which need not fit into memory (`write_clip`).
        frame_rate: frames/s of frames, which need it; for a clip, in place of its own.
        chip: its name, such as "spiketwo"; that of the scenario if None.
        tolerance: allowed relative error of the simulation; that of the scenario if None.
        seed: of the temporal noise; that of the scenario if None.
        device: part of an OpenCL device's name, or "numba".
        out: folder to keep, with images and report, and frames beside it in OUT.mkv; none is kept
            if None.
        resume: whether the interrupted run in `out` goes on, with the same arguments; that of a
            complete one is opened.
        progress: whether progress is shown on standard error; None for on a terminal and in a
            notebook.
        **settings: keys of the scenario, such as duration="64 ms" or **{"sensor.width": 400}.
            Frames are filmed for as long as they last.

    Returns:
        The spikes, in memory. For a stream that does not fit: `run("film", ...).stream`.

    Raises:
        InputError: the input cannot be used.
    """
    if resume and out is None:
        raise InputError("resume", "given with out", "alone", "add out and the folder")
    own: dict[str, Any] = {} if chip is None else {"sensor.chip": chip}
    frame_rate = _number(frame_rate)
    with TemporaryDirectory(prefix="viform-") as folder:
        scenario: str | os.PathLike[str] = "film"
        if not isinstance(source, (str, os.PathLike)):
            if frame_rate is None:
                raise InputError("frame_rate", "given with frames", "None", "give frames/s")
            path = source_file(out, folder, ".mkv", resume=resume)
            count = write_clip(source, path, frame_rate)
            own["scene.path"], own["duration"] = path, f"{count / frame_rate!r} s"
        else:
            if str(source) in shipped() or Path(source).suffix.lower() == ".toml":
                scenario = source
            else:
                own["scene.path"] = source
            if frame_rate is not None:
                own["scene.frame_rate"] = f"{frame_rate!r} Hz"
        done = run(
            scenario, out=Path(folder) / "run" if out is None else out, tolerance=tolerance,
            seed=seed, device=device, store="raw" if out is None else "fast", resume=resume,
            progress=progress, **(own | settings),
        )  # fmt: skip
        return part_of(done.stream)


def _number(frame_rate: Any) -> float | None:
    """A frame rate as a float. Raises InputError."""
    if frame_rate is None:
        return None
    if not isinstance(frame_rate, Real):
        raise InputError("frame_rate", "frames/s as a number", repr(frame_rate), "give a number")
    return float(frame_rate)
