"""A comparison: every camera films, one after another; folder, picture, page, document."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any, Final

import numpy as np

from cosim import PS, Clock, InputError, seconds_to_ps
from cosim.files.whole import whole
from cosim.run.folder import check_room, claim_folder, output_folder
from cosim.run.progress import Progress
from cosim.run.result import dumps, viform_version
from scenarios.assemble.view import make_view
from scenarios.studies.compare.frames import film_frames
from scenarios.studies.compare.motion import Motion
from scenarios.studies.compare.report import PICTURE, write_compare_report, write_picture
from scenarios.studies.compare.row import Camera
from scenarios.studies.compare.setting import SHAPE, SceneComparison, compared_imagers
from scenarios.studies.compare.spike import film_spikes

__all__ = ["run_compare"]

AT: Final = 0.6
"""Share of the duration at which the instant lies: long exposures then begin after the scene."""
REACH: Final = 42 * PS // 1000
"""Around the instant, ps: half of the longest exposure and the rows' own delays."""
LIGHT: Final = Clock(8000)
"""On whose edges the imagers' scene is drawn: finer than in a run, as edges are measured here (at
1 kHz the star's spokes, 144 a second, had a seventh of their way between two planes)."""
STEP: Final = PS // 4000
"""Between the planes that edges are measured against, ps."""
LONGEST: Final = 2.0
"""Seconds of scene at most."""


def run_compare(
    what: SceneComparison, out: Path | None, device: str | None, progress: Progress, began: float
) -> tuple[dict[str, Any], Path]:
    """The document, and the folder with `compare.json`, which is written last. Raises InputError
    before anything is written where something cannot be filmed."""
    seconds = what.spike.duration
    if not 0.01 <= seconds <= LONGEST:
        raise InputError(
            "duration", f"10 ms to {LONGEST:g} s in a comparison", f"{seconds:g} s", "change it"
        )
    instant = round(AT * seconds_to_ps(seconds))
    place = output_folder(f"compare-{what.name}", out, False)
    check_room(place, SHAPE[0] * SHAPE[1] * round(seconds * what.spike.sensor.clock))
    with claim_folder(f"compare-{what.name}", out, False, goes_on=False) as folder:
        cameras, lens, truth = film_spikes(what.spike, folder / "spike", instant, device, progress)
        white = what.spike.scene.illuminance * lens.gain
        mean = white * float(np.mean(truth(0)))
        notes = [
            f"the scene falls on {SHAPE[1]} x {SHAPE[0]} pixels of every camera, pixel by pixel "
            f"the same light: white is {white:.3g} lux on the pixels, f/{lens.f_number:.3g}",
            *what.notes,
            "each imager sees the first instant until its controls rest, then the scene; the "
            "middle of one exposure falls on the instant. Nothing is left out of any camera",
        ]
        motion = Motion(truth, instant, REACH, STEP, seconds_to_ps(seconds))
        for kind, comparison in compared_imagers().items():
            progress.start(kind, 1)
            given = what.imagers[kind]
            section = comparison.adjust(given.imager, white, mean, what.given[kind])
            scenario = given.model_copy(update={"imager": section})
            view = make_view(scenario, SHAPE, LIGHT)
            cameras.append(film_frames(scenario, comparison, view, motion, white))
            notes += [note for note in view.notes[1:] if note not in notes]
            progress.advance(1)
        return _finish(what, folder, cameras, truth(instant), instant, notes, began), folder


def _finish(
    what: SceneComparison, folder: Path, cameras: list[Camera], truth: Any, instant: int,
    notes: list[str], began: float,
) -> dict[str, Any]:  # fmt: skip
    write_picture(folder / PICTURE, cameras, truth)
    document = {
        "scene": what.name,
        "version": viform_version(),
        "seed": what.spike.seed,
        "duration_s": what.spike.duration,
        "instant_ms": instant * 1e-9,
        "rows": [camera.row() for camera in cameras],
        "notes": notes,
        "files": ["spike/stream.zarr", "spike/scenario.toml", PICTURE, "report.html",
                  "compare.json"],
        "run_time_s": time.perf_counter() - began,
    }  # fmt: skip
    write_compare_report(folder, what, document, cameras)
    with whole(folder / "compare.json") as part:
        part.write_text(dumps(document) + "\n", encoding="utf-8")
    return document
