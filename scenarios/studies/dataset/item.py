"""Makes one item: the stream of a camera as `.dat`, and its truth."""

from __future__ import annotations

import json
import time
from dataclasses import replace
from pathlib import Path
from shutil import rmtree
from typing import Any, Final

from cosim.compute.opencl import shared_device
from cosim.files import open_stream, write_stream
from cosim.files.durable import put
from cosim.plan.planner import Row, left_out_rows
from cosim.run.inputs import digest
from cosim.run.machine import NO_REPORT, Options
from cosim.run.progress import QuietProgress
from cosim.run.result import Metric, dumps
from cosim.spikes.viform import SpikeStream, count_spikes
from scenarios.assemble.called import called_camera
from scenarios.assemble.camera.setup import CameraSetup, set_up_camera
from scenarios.run import run_scenario
from scenarios.studies.batch.folder import write_document
from scenarios.studies.dataset.order import Item
from scenarios.studies.dataset.places import PARTS, Places, digest_of
from scenarios.studies.dataset.truth import write_truth

_IN_MEMORY: Final = 1 << 28
"""Bytes of a stream up to which it is filmed in memory."""
_TIMED: Final = frozenset({"camera", "full_physics"})
"""Metrics that depend on the speed of the machine, which a document leaves out."""


def make_item(
    item: Item, places: Places, device: str | None, checked: bool = True
) -> dict[str, Any]:
    """Makes an item and returns its document. Its files appear when all are there, and the document
    last.

    Args:
        item: the item.
        places: places of the item's files.
        device: see `choose_device`.
        checked: whether the error is measured against full physics on patches.

    Raises:
        InputError: it cannot be filmed: its clip is none, or the light does not suit the camera.
    """
    parts = places.folder / PARTS / item.name
    rmtree(parts, ignore_errors=True)
    try:
        made, document = _make(item, places, device, checked, parts)
        for part, name in made.items():
            place = places.folder / name
            place.parent.mkdir(parents=True, exist_ok=True)
            if place.is_dir() and not place.is_symlink():  # of an item that was damaged
                rmtree(place, ignore_errors=True)
            else:  # `put` replaces a file by a file alone
                place.unlink(missing_ok=True)
            put(part, place)
        write_document(places.document(item), document)
    finally:
        rmtree(parts, ignore_errors=True)
    return document


def _make(
    item: Item, places: Places, device: str | None, checked: bool, parts: Path
) -> tuple[dict[Path, str], dict[str, Any]]:
    """Files of an item and its folder of truth, with the places for them, and its document."""
    setup = replace(set_up_camera(item.scenario, device), device=shared_device(device))
    size = setup.cycles * setup.shape[0] * setup.shape[1] // 8
    parts.mkdir(parents=True)
    others = item.scenario.sensor.sub_threshold, item.scenario.readout
    if checked or size > _IN_MEMORY or any(each is not None for each in others):
        stream, found = _run(item, device, parts)
    else:
        stream, found = _filmed(setup)
    write_stream(stream, parts / "stream.dat")
    truth = parts / "truth"
    truth.mkdir()
    told = write_truth(setup, truth, parts / "gt.png")
    made = {
        parts / "stream.dat": places.recording(item), parts / "gt.png": places.image(item),
        truth: places.truth(item),
    }  # fmt: skip
    files = {name: part for part, name in made.items() if part != truth} | {
        f"{places.truth(item)}/{path.name}": path for path in sorted(truth.iterdir())
    }
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
        "image": places.image(item), "truth_folder": places.truth(item), **told, **found,
        "files": {name: digest_of(part) for name, part in files.items()},
    }  # fmt: skip
    return made, document


def _run(item: Item, device: str | None, parts: Path) -> tuple[SpikeStream, dict[str, Any]]:
    """The stream of a run, whose error is measured, and what its result states."""
    done = run_scenario(
        item.name, item.scenario, parts / "run",
        options=Options(device, store="raw", report=NO_REPORT), progress=QuietProgress(),
        began=time.perf_counter(),
    )  # fmt: skip
    result = json.loads(dumps(done.result.document()))
    metrics = {k: v for k, v in result["metrics"].items() if k not in _TIMED}
    return open_stream(parts / "run" / "stream.zarr"), {
        "outcome": result["outcome"], "error": result["error"], "plan": result["plan"],
        "metrics": metrics,
    }  # fmt: skip


def _filmed(setup: CameraSetup) -> tuple[SpikeStream, dict[str, Any]]:
    """The stream of a camera in memory, with the bits of a run, and what its plan states."""
    scenario = setup.scenario
    camera = called_camera(scenario, setup.setting, setup.device)
    relay = setup.lens.relay(setup.setting.chip.pitch)
    seen = camera.film(setup.source, relay, setup.cycles, spans=setup.spans)
    bounds = seen.error
    assert bounds is not None
    spikes = int(count_spikes(seen, 0, seen.cycles).sum())
    metrics = {
        "white_rate": Metric(setup.white_rate, "spikes/cycle"),
        "f_number": Metric(setup.lens.f_number, "1"),
        "spike_rate": Metric(spikes / (seen.cycles * seen.words[0].size), "spikes/cycle"),
    }
    return seen, {
        "outcome": "degraded" if seen.degraded else "ok",
        "error": {
            "value": None, "kind": None, "ci": None, "tolerance": scenario.tolerance,
            "bound": bounds.bound, "bound_kind": bounds.kind,
        },
        "plan": {
            "kept": list(bounds.kept),
            "left_out": left_out_rows(
                (Row(*each, bounds.kind) for each in bounds.left_out.items()), {}
            ),
        },
        "metrics": {name: metric.document() for name, metric in metrics.items()},
    }  # fmt: skip
