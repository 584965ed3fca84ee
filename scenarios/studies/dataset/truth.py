"""The ground truth of an item: light at its instants, and what a drawn scene knows besides."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from cosim import PS
from cosim.report.png import to_linear_bytes
from scenarios.assemble.camera.setup import CameraSetup
from scenarios.studies.dataset.formats import run_lengths, write_arrays, write_flo, write_grey


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
    from scenarios.scenes.objects.truth import categories, flow, surfaces

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
