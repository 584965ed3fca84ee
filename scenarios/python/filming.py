"""A scene, a clip or frames become spikes, for Python."""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, Final, Literal, overload

import numpy.typing as npt

from cosim import InputError
from cosim.run.machine import NO_REPORT
from cosim.run.shown import progress_in_python
from cosim.spikes.viform import part_of
from scenarios.assemble.called import film_in_memory, filmed_in_memory, in_memory
from scenarios.assemble.schema.loading import assignments_of, load, shipped
from scenarios.python.camera import Camera
from scenarios.python.errors import in_python
from scenarios.python.finished import Run
from scenarios.python.frames import array_of, rate_of, write_frames
from scenarios.python.runs import joined, refuse_of_run, run, source_file
from sensor.latched.core import Recorded

if TYPE_CHECKING:
    from sensor.asynchronous.core import RecordedEvents
    from sensor.continuous.core import RecordedIntensities

_OF_FRAMES: Final = ("scene.path", "scene.frame_rate")
"""Keys of a scene that frames in memory take the place of."""


@overload
def film(
    source: str | os.PathLike[str] | Iterable[npt.ArrayLike] = ..., *,
    frame_rate: float | None = ..., chip: str | None = ...,
    pixel: Literal["latched"] | None = ...,
    tolerance: float | None = ..., seed: int | None = ..., device: str | None = ...,
    out: str | os.PathLike[str] | None = ..., resume: bool = ..., report: str = ...,
    progress: bool | None = ..., **settings: Any,
) -> Recorded: ...  # fmt: skip
@overload
def film(
    source: str | os.PathLike[str] | Iterable[npt.ArrayLike] = ..., *,
    frame_rate: float | None = ..., chip: str | None = ..., pixel: Literal["asynchronous"],
    tolerance: float | None = ..., seed: int | None = ..., device: str | None = ...,
    out: str | os.PathLike[str] | None = ..., resume: bool = ..., report: str = ...,
    progress: bool | None = ..., **settings: Any,
) -> RecordedEvents: ...  # fmt: skip
@overload
def film(
    source: str | os.PathLike[str] | Iterable[npt.ArrayLike] = ..., *,
    frame_rate: float | None = ..., chip: str | None = ..., pixel: Literal["continuous"],
    tolerance: float | None = ..., seed: int | None = ..., device: str | None = ...,
    out: str | os.PathLike[str] | None = ..., resume: bool = ..., report: str = ...,
    progress: bool | None = ..., **settings: Any,
) -> RecordedIntensities: ...  # fmt: skip
@in_python
def film(
    source: str | os.PathLike[str] | Iterable[npt.ArrayLike] = "film", *,
    frame_rate: float | None = None, chip: str | None = None, pixel: str | None = None,
    tolerance: float | None = None, seed: int | None = None, device: str | None = None,
    out: str | os.PathLike[str] | None = None, resume: bool = False, report: str = "page",
    progress: bool | None = None, **settings: Any,
) -> Recorded | RecordedEvents | RecordedIntensities:  # fmt: skip
    """Films a source with a spike camera: the bits of `viform run`. Without `out`, what a camera
    alone sees is filmed in memory, see `Camera`; the bounds of its plan are not checked on patches.

    Args:
        source: a scenario of `viform list` or a TOML file; a clip or image; or frames, as an array
            (T, H, W), a list, or a generator, see `Camera.film`.
        frame_rate: frames/s of frames, which need it; for a clip, in place of its own.
        chip: its name, such as "spiketwo"; that of the scenario if None.
        pixel: "latched", "asynchronous" or "continuous", see `Camera`; that of the scenario
            if None.
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
        The spikes, events or intensities in memory, as of a `Camera`; their `error` is None where a
        run was made. For a stream that does not fit: `run("film", ...).stream`.

    Raises:
        InputError: the input cannot be used.
    """
    if out is None:
        refuse_of_run(resume, report)
    named = isinstance(source, (str, os.PathLike))
    scenario: str | os.PathLike[str] = "film"
    own: dict[str, Any] = {} if named else {"scene.path": None}
    if isinstance(source, (str, os.PathLike)):
        if str(source) in shipped() or Path(source).suffix.lower() == ".toml":
            scenario = source
        else:
            own["scene.path"] = source
    if frame_rate is not None:
        own["scene.frame_rate"] = f"{rate_of(frame_rate)!r} Hz"
    elif not named:
        raise InputError("frame_rate", "given with frames", "None", "give frames/s")
    camera = {"sensor.chip": chip, "sensor.pixel": pixel}
    own |= {key: value for key, value in camera.items() if value is not None}
    given = joined(own, settings)
    with TemporaryDirectory(prefix="viform-") as folder:
        if not isinstance(source, (str, os.PathLike)):
            assert frame_rate is not None
            rate = rate_of(frame_rate)
            if out is None:
                source = array_of(source)
                kept = {key: given[key] for key in given if key not in _OF_FRAMES}
                kept = {"duration": f"{len(source) / rate!r} s"} | kept
                _, loaded = load("film", assignments_of(kept), tolerance=tolerance, seed=seed)
                called = in_memory(loaded)
                if called is not None:
                    return Camera.of(called, device).film_scenario(source, rate)
            path = source_file(out, folder, ".npy", resume=resume)
            count = write_frames(source, path)
            given = {"duration": f"{count / rate!r} s"} | given | {"scene.path": path}
        if out is None:
            _, loaded = load(str(scenario), assignments_of(given), tolerance=tolerance, seed=seed)
            filmed = filmed_in_memory(loaded)
            if filmed is not None:
                latched = filmed.sensor.pixel == "latched"
                with progress_in_python(progress) as shown:
                    seen: Recorded | RecordedEvents | RecordedIntensities = (
                        film_in_memory(filmed, device) if latched
                        else Camera.of(filmed, device).film_scene()
                    )  # fmt: skip
                    for note in seen.notes:
                        shown.note(note)
                return seen
        done = run(
            scenario, out=Path(folder) / "run" if out is None else out, tolerance=tolerance,
            seed=seed, device=device, store="raw" if out is None else "fast", resume=resume,
            report=NO_REPORT if out is None else report, progress=progress, **given,
        )  # fmt: skip
        return _recorded(done)


def _recorded(done: Run) -> Recorded | RecordedEvents | RecordedIntensities:
    """What the camera of a run has recorded, in memory; with a display, its planes."""
    from sensor.asynchronous.core import RecordedEvents  # compiled pixels take long to load
    from sensor.continuous.core import RecordedIntensities

    if "stream" not in done.streams:
        if done.events is not None:
            return RecordedEvents(**vars(done.events), notes=done.notes)
        if done.intensities is not None:
            return RecordedIntensities(**vars(done.intensities), notes=done.notes)
    return Recorded(**vars(part_of(done.stream)), notes=done.notes)
