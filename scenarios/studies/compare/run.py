"""Runs a comparison: simulates the cameras one after another; writes picture, report, document."""

from __future__ import annotations

import time
from dataclasses import asdict
from pathlib import Path
from typing import Any, Final

import numpy as np

from cosim import PS, Clock, InputError, seconds_to_ps
from cosim.files.atomic import atomic_write
from cosim.run.folder import check_room, claim_folder, output_folder
from cosim.run.progress import Progress
from cosim.run.result import dumps, viform_version
from scenarios.assemble.source.imager import make_view
from scenarios.studies.compare.frames import film_frames
from scenarios.studies.compare.measure import Camera
from scenarios.studies.compare.motion import Motion
from scenarios.studies.compare.report import (
    PICTURE,
    SNR,
    write_compare_report,
    write_picture,
    write_snr,
)
from scenarios.studies.compare.setting import SHAPE, SceneComparison, compared_imagers
from scenarios.studies.compare.spike import film_spikes

AT: Final = 0.6
"""The instant as a share of the duration: long exposures then begin after the start of the
scene."""
REACH: Final = 42 * PS // 1000
"""Extent of means around the instant, ps: half of the longest exposure plus the row delays."""
LIGHT: Final = Clock(8000)
"""Clock on whose edges the scene is drawn for imagers. It is faster than in a run, because edges
are measured: at 1 kHz the star's spokes, 144 a second, moved a seventh of a period between
planes."""
STEP: Final = PS // 4000
"""Time between the planes against which edges are measured, ps."""
LONGEST: Final = 2.0
"""Maximum duration of the scene, s."""


def run_compare(
    comparison: SceneComparison,
    out: Path | None,
    device: str | None,
    progress: Progress,
    began: float,
) -> tuple[dict[str, Any], Path]:
    """Runs a comparison.

    Args:
        comparison: the scene and the settings of the cameras.
        out: folder to create; runs/compare-<name>-<n> if None.
        device: number or part of the name of an OpenCL device, "numba", or None for the default.
        progress: receives progress and notes.
        began: time.perf_counter() at the start of the command.

    Returns:
        The document, and the folder with `compare.json`, which is written last.

    Raises:
        InputError: the duration or a camera is invalid; nothing has been written.
    """
    seconds = comparison.spike.duration
    if not 0.01 <= seconds <= LONGEST:
        raise InputError(
            "duration", f"10 ms to {LONGEST:g} s in a comparison", f"{1e3 * seconds:g} ms",
            f"write --set duration='{'10 ms' if seconds < 1 else f'{LONGEST:g} s'}'",
        )  # fmt: skip
    instant = round(AT * seconds_to_ps(seconds))
    place = output_folder(f"compare-{comparison.name}", out, False, goes_on=False)
    check_room(place, SHAPE[0] * SHAPE[1] * round(seconds * comparison.spike.sensor.clock))
    with claim_folder(f"compare-{comparison.name}", out, False, goes_on=False) as folder:
        cameras, lens, truth = film_spikes(
            comparison.spike, folder / "spike", instant, device, progress
        )
        white = comparison.spike.scene.illuminance * lens.gain
        mean = white * float(np.mean(truth(0)))
        notes = [
            f"the scene covers {SHAPE[1]} x {SHAPE[0]} pixels of every camera, with the same light "
            f"on each pixel: white is {white:.3g} lux on the pixels, f/{lens.f_number:.3g}",
            *comparison.notes,
            "each imager records the first instant until its controls settle, then the scene; the "
            "middle of one exposure is at the instant. Every camera has every effect",
        ]
        motion = Motion(truth, instant, REACH, STEP, seconds_to_ps(seconds))
        for kind, side in compared_imagers().items():
            progress.start(kind, 1)
            scenario = comparison.imagers[kind]
            section = side.adjust(scenario.imager, white, mean, comparison.user_keys[kind])
            scenario = scenario.model_copy(update={"imager": section})
            view = make_view(scenario, SHAPE, LIGHT)
            cameras.append(film_frames(scenario, side, view, motion, white))
            notes += [note for note in view.notes[1:] if note not in notes]
            progress.advance(1)
        return _finish(comparison, folder, cameras, truth(instant), instant, notes, began), folder


def _finish(
    comparison: SceneComparison, folder: Path, cameras: list[Camera], truth: Any, instant: int,
    notes: list[str], began: float,
) -> dict[str, Any]:  # fmt: skip
    """Writes picture, report and document into the folder; returns the document."""
    snr = write_snr(folder / SNR, cameras)
    write_picture(folder / PICTURE, cameras, truth)
    document = {
        "scene": comparison.name,
        "version": viform_version(),
        "seed": comparison.spike.seed,
        "duration_s": comparison.spike.duration,
        "instant_ms": instant * 1e-9,
        "rows": [camera.row() for camera in cameras],
        "snr": {camera.name: [asdict(point) for point in camera.snr] for camera in cameras},
        "notes": notes,
        "files": ["spike/stream.zarr", "spike/scenario.toml", PICTURE, SNR, "report.html",
                  "compare.json"],
        "run_time_s": time.perf_counter() - began,
    }  # fmt: skip
    write_compare_report(folder, comparison, document, cameras, truth, snr)
    with atomic_write(folder / "compare.json") as part:
        part.write_text(dumps(document) + "\n", encoding="utf-8")
    return document
