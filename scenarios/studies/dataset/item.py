"""Makes one item: a run without report, its stream as `.dat`, and its truth."""

from __future__ import annotations

import json
import time
from pathlib import Path
from shutil import rmtree
from typing import Any, Final

from cosim.files import open_stream, write_stream
from cosim.files.durable import put
from cosim.run.inputs import digest
from cosim.run.machine import Options
from cosim.run.progress import QuietProgress
from cosim.run.result import dumps
from scenarios.assemble.camera.setup import set_up_camera
from scenarios.run import run_scenario
from scenarios.studies.batch.folder import write_document
from scenarios.studies.dataset.order import Item
from scenarios.studies.dataset.places import PARTS, Places, digest_of
from scenarios.studies.dataset.truth import write_truth

__all__ = ["make_item"]

_TIMED: Final = frozenset({"camera", "full_physics"})
"""Metrics that depend on the speed of the machine, which a document leaves out."""


def make_item(item: Item, places: Places, device: str | None) -> dict[str, Any]:
    """Makes an item and returns its document. Its files appear when all are there, and the document
    last.

    Raises:
        InputError: it cannot be filmed: its clip is none, or the light does not suit the camera.
    """
    parts = places.folder / PARTS / item.name
    rmtree(parts, ignore_errors=True)
    try:
        made, document = _make(item, places, device, parts)
        for part, name in made.items():
            place = places.folder / name
            place.parent.mkdir(parents=True, exist_ok=True)
            put(part, place)
        write_document(places.document(item), document)
    finally:
        rmtree(parts, ignore_errors=True)
    return document


def _make(
    item: Item, places: Places, device: str | None, parts: Path
) -> tuple[dict[Path, str], dict[str, Any]]:
    """Files of an item, with the places for them, and its document."""
    done = run_scenario(
        item.name, item.scenario, parts / "run", options=Options(device, False, None, "raw"),
        progress=QuietProgress(), began=time.perf_counter(), report=lambda machine, run: [],
    )  # fmt: skip
    stream = open_stream(parts / "run" / "stream.zarr")
    write_stream(stream, parts / "stream.dat")
    truth = parts / "truth"
    truth.mkdir()
    setup = set_up_camera(item.scenario, device)
    told = write_truth(setup, truth, parts / "gt.png")
    made = {
        parts / "stream.dat": places.recording(item), parts / "gt.png": places.image(item)
    } | {path: f"{places.truth(item)}/{path.name}" for path in sorted(truth.iterdir())}  # fmt: skip
    result = json.loads(dumps(done.result.document()))
    clip = getattr(item.scenario.scene, "path", None)
    scenario = item.scenario.model_dump(mode="json", exclude_none=True)
    if clip is not None:  # not where it stands on this machine
        scenario["scene"]["path"] = item.source
    document = {
        "name": item.name, "view": item.view, "source": item.source,
        "source_sha256": None if clip is None else digest(clip),
        "camera": item.camera, "split": item.split,
        "drawn": item.values, "seed": item.scenario.seed, "scenario": scenario,
        "cycles": stream.cycles, "height": stream.shape[0], "width": stream.shape[1],
        "clock_hz": stream.clock.hz, "recording": places.recording(item),
        "image": places.image(item), "truth_folder": places.truth(item), **told,
        "outcome": result["outcome"], "error": result["error"], "plan": result["plan"],
        "metrics": {k: v for k, v in result["metrics"].items() if k not in _TIMED},
        "files": {name: digest_of(part) for part, name in made.items()},
    }  # fmt: skip
    return made, document
