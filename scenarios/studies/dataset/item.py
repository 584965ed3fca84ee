"""Makes one item of a data set: the stream of a camera as `.dat`, and its ground truth, which is
light at its instants and what a drawn scene knows besides, in files of the field's formats.

`.flo`, of the Middlebury flow benchmark (S. Baker et al., IJCV 92:1, 2011): the float32
202021.25, which is the text PIEH, width and height as int32, then u and v of each pixel as float32,
row by row; all little-endian.
COCO (T.-Y. Lin et al., ECCV 2014): boxes as [x, y, width, height] from the upper left corner, and
masks as run lengths of a column-major mask, of 0 first.
"""

from __future__ import annotations

import json
import time
from dataclasses import replace
from io import BytesIO
from itertools import pairwise
from pathlib import Path
from shutil import rmtree
from typing import Any, Final
from zipfile import ZIP_DEFLATED, ZIP_STORED, ZipFile, ZipInfo

import cv2
import numpy as np
import numpy.typing as npt
from numpy.lib.format import write_array

from cosim import PS
from cosim.compute.opencl import shared_device
from cosim.files import open_stream, write_stream
from cosim.files.atomic import put
from cosim.plan.planner import EffectRow, left_out_rows
from cosim.report.png import to_linear_bytes
from cosim.run.inputs import digest
from cosim.run.machine import NO_REPORT, Options
from cosim.run.progress import QuietProgress
from cosim.run.result import Metric, dumps
from cosim.spikes.viform import SpikeStream, count_spikes
from scenarios.assemble.called import called_camera
from scenarios.assemble.source.latched.setup import CameraSetup, set_up_camera
from scenarios.run import run_scenario
from scenarios.studies.batch.jobs import write_document
from scenarios.studies.dataset.order import PARTS, Item, Places, digest_of

MAGIC: Final = np.float32(202021.25)
_IN_MEMORY: Final = 1 << 28
"""Bytes of a stream up to which it is filmed in memory."""
_TIMED: Final = frozenset({"camera", "full_physics"})
"""Metrics that depend on the speed of the machine, which a document leaves out."""


def write_flo(path: Path, flow: npt.NDArray[np.float32]) -> None:
    """Writes optical flow, (H, W, 2) pixels to the right and down."""
    height, width = flow.shape[:2]
    with path.open("wb") as file:
        file.write(MAGIC.astype("<f4").tobytes())
        file.write(np.array([width, height], "<i4").tobytes())
        file.write(np.ascontiguousarray(flow, "<f4").tobytes())


def write_grey(path: Path, image: npt.NDArray[np.uint8]) -> None:
    """Writes (H, W) uint8 as PNG."""
    path.write_bytes(cv2.imencode(".png", image)[1].tobytes())


def write_arrays(path: Path, arrays: dict[str, npt.NDArray[Any]], stored: str = "") -> None:
    """Writes arrays as a compressed `.npz`, the same bytes for the same arrays. NumPy's own form
    compresses three times as long, for a few per cent of the size. stored: name of the one that is
    not compressed."""
    with ZipFile(path, "w") as archive:
        for name, array in arrays.items():
            file, kind = BytesIO(), ZIP_STORED if name == stored else ZIP_DEFLATED
            write_array(file, np.ascontiguousarray(array), allow_pickle=False)
            archive.writestr(ZipInfo(f"{name}.npy"), file.getbuffer(), kind, 1)


def run_lengths(mask: npt.NDArray[np.bool_]) -> list[int]:
    """COCO's uncompressed run lengths of a mask (H, W), column by column, zeros first."""
    flat = mask.ravel(order="F")
    ends = np.flatnonzero(np.diff(flat)) + 1
    lengths: list[int] = np.diff([0, *ends, flat.size]).tolist()
    return [0, *lengths] if flat.size and flat[0] else lengths


def write_truth(setup: CameraSetup, folder: Path, image: Path) -> dict[str, Any]:
    """Writes the truth of a camera's scene.

    Args:
        setup: the camera.
        folder: empty folder for the truth at the instants of its images.
        image: PNG to write, the true light in the middle of the recording.

    Returns:
        What the item's document has of it: instants, kind, and for a scene with dense truth the
        boxes of its objects for COCO.
    """
    clock, middle = setup.setting.clock, setup.cycles // 2
    instants = sorted(setup.instants)
    source = setup.source()
    light = {n: source.truth(clock.middle(n)) for n in sorted({*instants, middle})}
    write_grey(image, to_linear_bytes(light[middle]))
    for n in instants:
        write_grey(folder / f"light-{n:06}.png", to_linear_bytes(light[n]))
    ps = np.array([clock.middle(n) for n in instants], np.int64)
    arrays: dict[str, npt.NDArray[Any]] = {
        "light": np.stack([light[n] for n in instants]),
        "cycle": np.array(instants, np.int64),
        "time_ps": ps,
    }
    told: dict[str, Any] = {"instants": instants, "middle": middle, "truth": "light"}
    closed_form = getattr(setup.scenario.scene, "closed_form", None)
    if closed_form is not None:
        dense, boxes = _dense(closed_form(setup.shape), instants, (ps / PS).tolist(), folder)
        arrays |= dense
        told |= {"truth": "dense", "objects": boxes}
    # Compressed, light would be a fifth of the time of an item, for a tenth of its size.
    write_arrays(folder / "truth.npz", arrays, stored="light")
    return told


def _dense(
    scene: Any, instants: list[int], seconds: list[float], folder: Path
) -> tuple[dict[str, npt.NDArray[Any]], list[dict[str, Any]]]:
    """Writes flow, occlusion and masks; returns the arrays of `truth.npz`, and a row for each
    object that is seen at an instant."""
    from scenarios.scenes.objects.scene import categories, flow, surfaces

    names = categories(scene)
    seen = [surfaces(scene, t) for t in seconds]
    boxes = [each.boxes(len(names)) for each in seen]
    rows: list[dict[str, Any]] = []
    for n, each, found in zip(instants, seen, boxes, strict=True):
        write_grey(folder / f"mask-{n:06}.png", each.labels)
        rows += [
            {
                "cycle": n, "object": k + 1, "category": names[k],
                "bbox": found[k, :4].tolist(), "area": int(found[k, 4]),
                "counts": run_lengths(each.labels == k + 1),
            }
            for k in range(len(names)) if found[k, 4]
        ]  # fmt: skip
    moved = []
    for n, (a, b) in enumerate(pairwise(instants)):
        uv, occlusion = flow(scene, seconds[n], seconds[n + 1], seen[n])
        write_flo(folder / f"flow-{a:06}-{b:06}.flo", uv)
        write_grey(folder / f"occlusion-{a:06}-{b:06}.png", occlusion)
        moved.append((uv, occlusion))
    shape = scene.shape
    arrays: dict[str, npt.NDArray[Any]] = {
        "depth_m": np.stack([each.depth for each in seen]),
        "mask": np.stack([each.labels for each in seen]),
        "boxes": np.stack(boxes)[..., :4].astype(np.float32),
        "flow": np.array([uv for uv, _ in moved], np.float32).reshape(-1, *shape, 2),
        "occlusion": np.array([each for _, each in moved], np.uint8).reshape(-1, *shape),
    }
    return arrays, rows


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
            "bound": bounds.bound, "bound_kind": bounds.kind, "of": bounds.of,
            "law": None if bounds.law is None else bounds.law.document(),
        },
        "plan": {
            "kept": list(bounds.kept),
            "left_out": left_out_rows(
                (EffectRow(*each, bounds.kind) for each in bounds.left_out.items()), {}
            ),
        },
        "metrics": {name: metric.document() for name, metric in metrics.items()},
    }  # fmt: skip
