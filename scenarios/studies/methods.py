"""The methods of images from spikes beside the true light, on one stream."""

from __future__ import annotations

import struct
import time
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Final

import numpy as np

from cosim import InputError, Plane, SpikeStream
from cosim.config.toml import read_toml
from cosim.run.chain import STREAM
from cosim.run.progress import Progress
from scenarios.assemble.source.recording.opening import known_white
from scenarios.studies.compare.measure import still_blur
from sensor.reconstruct import METHODS, reconstruct
from sensor.reconstruct.fidelity import psnr, ssim, to_white
from sensor.reconstruct.intervals import TIES, Ties
from sensor.reconstruct.readings import DimLight

Truths = Mapping[int, Plane]
"""True reflectance, white = 1, (H, W), by cycle."""
_PNG: Final = b"\x89PNG\r\n\x1a\n"
_HEAD: Final = 24
"""Bytes of a PNG up to its width and height (W3C PNG, 5.2 and 11.2.1)."""
_UNEVEN: Final = {
    "writes": "a threshold that changes gives white several rates",
    "colour": "the methods take all pixels for grey ones",
}
"""Keys of [sensor] with which a run cannot be compared, and why."""


@dataclass(frozen=True)
class Tried:
    """A window that was tried, cycles, and its PSNR."""

    window: int | None
    psnr_db: float


@dataclass(frozen=True)
class MethodRow:
    """One method, as the mean over the instants.

    Attributes:
        method: its name.
        window: its window, cycles; the best of those in `searched`; None for none.
        psnr_db, ssim: PSNR (dB) and SSIM against the true light; see `sensor.reconstruct.fidelity`.
        edge_px: 10 to 90 % width of an edge of the truth, blurred to fit the image; None where
            blur explains none of the images.
        processor_s: processor time of one image, all threads together.
        plain_share, one_sided_share: share of the pixels without motion alignment, and with that
            of one half of the window; None for methods without.
        searched: windows that were tried; empty without a search.
    """

    method: str
    window: int | None
    psnr_db: float
    ssim: float
    edge_px: float | None
    processor_s: float
    plain_share: float | None
    one_sided_share: float | None
    searched: list[Tried]


def compare_methods(
    stream: SpikeStream,
    truths: Truths,
    white: float,
    dim_light: DimLight | None = None,
    progress: Progress | None = None,
    *,
    ties: Ties = "before",
) -> list[MethodRow]:
    """A row for each of `METHODS`. One with a choice of windows has the one of the best PSNR.

    Args:
        white: spikes a cycle of white.
        dim_light: how dim pixels are imaged; None for from spikes alone.
        ties: interval of TFI of a pixel that fires at the instant; see `interval_image`.

    Raises:
        InputError: the stream does not hold an instant, or is too small for a method.
    """
    fitting: dict[str, list[int | None]] = {
        name: [w for w in method.best if w <= stream.cycles] or [method.window]
        for name, method in METHODS.items()
    }
    if progress is not None:
        progress.start("methods", sum(len(windows) + 1 for windows in fitting.values()))
    rows, done = [], 0
    for name, windows in fitting.items():
        reached = {}
        held = ties if METHODS[name].ties else TIES[0]
        image = partial(reconstruct, stream, name, ties=held, dim_light=dim_light)
        for window in windows:
            made = [image(at, window) for at in truths]
            light = [to_white(each.rate, white) for each in made]
            reached[window] = float(np.mean(list(map(psnr, light, truths.values()))))
            done += 1
            if progress is not None:
                progress.advance(done)
        best = max(reached, key=lambda window: reached[window])
        begin = time.process_time()  # all is compiled by now
        made = [image(at, best) for at in truths]
        spent = (time.process_time() - begin) / len(truths)
        light = [to_white(each.rate, white) for each in made]
        widths = [
            still_blur(seen, truth.astype(float))
            for seen, truth in zip(light, truths.values(), strict=True)
        ]
        edges = [width for width in widths if width is not None]
        pixels = len(truths) * light[0].size
        plain, one_sided = (
            None if None in counts else sum(n for n in counts if n is not None) / pixels
            for counts in ([i.plain for i in made], [i.one_sided for i in made])
        )
        likeness = float(np.mean(list(map(ssim, light, truths.values()))))
        tried = [Tried(window, psnr_db) for window, psnr_db in reached.items() if len(reached) > 1]
        rows.append(
            MethodRow(
                name, best, reached[best], likeness, float(np.mean(edges)) if edges else None,
                spent, plain, one_sided, tried,
            )
        )  # fmt: skip
        done += 1
        if progress is not None:
            progress.advance(done)
    return rows


def truth_of_run(path: Path, shape: tuple[int, int]) -> tuple[Truths, float]:
    """True light at the instants of a run, whose folder or stream this is, and the spike rate of
    white. It is 8-bit: an image is at most 59 dB from it.

    Raises:
        InputError: what is no folder of a run with images of its truth, or of one whose white has
            no single rate.
    """
    folder = path.parent if path.name == STREAM else path
    found, white = sorted((folder / "images").glob("truth-*.png")), known_white(path)
    if not found or white is None:
        raise InputError(
            "STREAM", "the folder of a run with images of its truth", str(path),
            "give --truth FILE --at N --scale RATE",
        )  # fmt: skip
    try:
        sensor = read_toml(folder / "scenario.toml").get("sensor", {})
    except (OSError, ValueError):
        sensor = {}
    for key, reason in _UNEVEN.items():
        if key in sensor:
            raise InputError("STREAM", f"a run without sensor.{key}", f"{path}, where {reason}",
                             "give --truth FILE --at N --scale RATE")  # fmt: skip
    return {int(file.stem.partition("-")[2]): truth_of_file(file, shape) for file in found}, white


def _check_size(own: tuple[int, ...], shape: tuple[int, int]) -> None:
    """Raises InputError for a picture of another size than the stream's."""
    if len(own) == len(shape) and own != shape:
        size, given = (f"{s[1]}x{s[0]}" for s in (shape, own))
        raise InputError("the truth", f"{size}, as the stream", given, "give that of the stream")


def truth_of_file(path: Path, shape: tuple[int, int]) -> Plane:
    """Reflectance, white = 1, (H, W) float32, of a linear grey PNG of 8 or 16 bits, or a `.npy`.
    Raises InputError for another file, or another size."""
    import cv2

    try:
        if path.suffix.lower() == ".npy":
            plane = np.load(path, mmap_mode="r", allow_pickle=False)
            _check_size(plane.shape, shape)
        else:
            data = np.fromfile(path, np.uint8)
            head = data[:_HEAD].tobytes()
            if head[:8] != _PNG or len(head) < _HEAD:
                raise ValueError("no PNG")
            wide, high = struct.unpack(">2I", head[16:])
            _check_size((high, wide), shape)  # before it is unpacked
            plane = cv2.imdecode(data, cv2.IMREAD_UNCHANGED)
            if plane is None:
                raise ValueError("no picture")
        if plane.ndim != 2 or plane.dtype.kind not in "uf" or not np.isfinite(plane).all():
            raise ValueError(f"{plane.dtype} of shape {plane.shape}")
    except (OSError, ValueError, EOFError) as exc:
        what = "a grey PNG, or a .npy of (H, W) finite numbers"
        raise InputError("the truth", what, f"{path} ({exc})", "check it") from exc
    most = np.iinfo(plane.dtype).max if plane.dtype.kind == "u" else 1
    return np.asarray(plane / np.float32(most), np.float32)
