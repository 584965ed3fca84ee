"""A scene, a clip or frames become spikes, for Python."""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy.typing as npt

from cosim import Events, InputError, Intensities, Viform
from cosim.run.machine import NO_REPORT
from cosim.run.shown import progress_in_python
from cosim.spikes.viform import part_of
from scenarios.assemble.called import film_in_memory, filmed_in_memory, in_memory
from scenarios.assemble.schema.loading import load, shipped
from scenarios.assemble.schema.settings import assignments_of
from scenarios.python.camera import Camera
from scenarios.python.finished import Run
from scenarios.python.frames import array_of, rate_of, write_frames
from scenarios.python.running import run, source_file
from scenarios.python.words import in_python


@in_python
def film(
    source: str | os.PathLike[str] | Iterable[npt.ArrayLike] = "film", *,
    frame_rate: float | None = None, chip: str | None = None, tolerance: float | None = None,
    seed: int | None = None, device: str | None = None,
    out: str | os.PathLike[str] | None = None, resume: bool = False, report: str = "page",
    progress: bool | None = None, **settings: Any,
) -> Viform | Any:  # fmt: skip
    """Films a source with a spike camera: the bits of `viform run`. Without `out`, frames and what
    a latched camera sees are filmed in memory, see `Camera`; the bounds of its plan are not checked
    on patches.

    Args:
        source: a scenario of `viform list` or a TOML file; a clip or image; or frames, as an array
            (T, H, W), a list, or a generator, see `Camera.film`.
        frame_rate: frames/s of frames, which need it; for a clip, in place of its own.
        chip: its name, such as "spiketwo"; that of the scenario if None.
        tolerance: allowed relative error of the simulation; that of the scenario if None.
        seed: seed of the temporal noise; that of the scenario if None.
        device: number or part of the name of an OpenCL device, or "numba".
        out: folder to keep, with images and report, and frames beside it in OUT.npy; none is kept
            if None.
        resume: whether the interrupted run in `out` goes on, with the same arguments; that of a
            complete one is opened.
        report: what the run in `out` makes: page, or none for the result and the stream alone.
        progress: whether progress is shown on standard error; None for on a terminal and in a
            notebook.
        **settings: keys of the scenario, such as duration="64 ms" or **{"sensor.width": 400}.
            Frames are filmed for as long as they last.

    Returns:
        The spikes, in memory; `Events` with sensor.pixel = asynchronous, and `Intensities` with
        continuous, as of a `Camera`. For a stream that does not fit: `run("film", ...).stream`.

    Raises:
        InputError: the input cannot be used.
    """
    if resume and out is None:
        raise InputError("resume", "given with out", "alone", "add out and the folder")
    if report != "page" and out is None:
        raise InputError("report", "given with out", "alone", "add out and the folder")
    own: dict[str, Any] = {} if chip is None else {"sensor.chip": chip}
    rate = None if frame_rate is None else rate_of(frame_rate)
    with TemporaryDirectory(prefix="viform-") as folder:
        scenario: str | os.PathLike[str] = "film"
        if not isinstance(source, (str, os.PathLike)):
            if rate is None:
                raise InputError("frame_rate", "given with frames", "None", "give frames/s")
            if out is None:
                frames = array_of(source)
                given = {"duration": f"{len(frames) / rate!r} s"} | own | settings
                _, loaded = load("film", assignments_of(given), tolerance=tolerance, seed=seed)
                called = in_memory(loaded)
                if called is not None:
                    return Camera.of(called, device).film_scenario(frames, rate)
                source = frames
            path = source_file(out, folder, ".npy", resume=resume)
            count = write_frames(source, path)
            own["scene.path"], own["duration"] = path, f"{count / rate!r} s"
            own["scene.frame_rate"] = f"{rate!r} Hz"
        else:
            if str(source) in shipped() or Path(source).suffix.lower() == ".toml":
                scenario = source
            else:
                own["scene.path"] = source
            if rate is not None:
                own["scene.frame_rate"] = f"{rate!r} Hz"
        if out is None:
            assignments = assignments_of(own | settings)
            _, loaded = load(str(scenario), assignments, tolerance=tolerance, seed=seed)
            filmed = filmed_in_memory(loaded)
            if filmed is not None:
                with progress_in_python(progress) as shown:
                    seen = film_in_memory(filmed, device)
                    for note in seen.notes:
                        shown.note(note)
                return seen
        done = run(
            scenario, out=Path(folder) / "run" if out is None else out, tolerance=tolerance,
            seed=seed, device=device, store="raw" if out is None else "fast", resume=resume,
            report=NO_REPORT if out is None else report, progress=progress, **(own | settings),
        )  # fmt: skip
        return _recorded(done)


def _recorded(done: Run) -> Viform | Events | Intensities:
    """What the camera of a run has recorded, in memory; with a display, its planes."""
    if "stream" not in done.streams:
        for kept in (done.events, done.intensities):
            if kept is not None:
                return kept
    return part_of(done.stream)
