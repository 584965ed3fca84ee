"""Spikes of a panel seen by ideal pixels: a model apart from that of air and sensor."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from cosim.spikes.viform import pack_planes
from link.layout import Layout, pilots
from link.timing import Registration, Timing

PILOTS = pilots()
FINE = 4
"""Samples along a pixel's side."""


@dataclass
class Scene:
    """bits: (symbols, cells) that the data cells show. words: from tick `start` on."""

    layout: Layout
    registration: Registration
    timing: Timing
    bits: npt.NDArray[np.bool_]
    words: npt.NDArray[np.uint32]
    start: int = 0


def homography(
    layout: Layout, shape: tuple[int, int], scale: float, degrees: float = 0.0,
    offset: tuple[float, float] = (0.0, 0.0), tilt: float = 0.0,
) -> npt.NDArray[np.float64]:  # fmt: skip
    """The panel's centre on the sensor's, moved by offset; tilt: change of scale to its edge."""
    cx, cy = (layout.mode.width - 1) / 2, (layout.mode.height - 1) / 2
    a = np.deg2rad(degrees)
    to_middle = np.array([[1, 0, -cx], [0, 1, -cy], [0, 0, 1]], float)
    perspective = np.array([[1, 0, 0], [0, 1, 0], [tilt / cx, tilt / (2 * cy), 1]], float)
    turn = np.array(
        [
            [scale * np.cos(a), -scale * np.sin(a), (shape[1] - 1) / 2 + offset[0]],
            [scale * np.sin(a), scale * np.cos(a), (shape[0] - 1) / 2 + offset[1]],
            [0, 0, 1],
        ]
    )
    return turn @ perspective @ to_middle


def panel(layout: Layout, bits: npt.NDArray[np.bool_], symbol: int) -> npt.NDArray[np.float32]:
    """Panel pixels of a symbol: data, pilots, and tags that are on all over."""
    rows, columns = layout.shape
    cells = np.zeros(rows * columns, np.float32)
    cells[layout.data] = bits
    cells = cells.reshape(rows, columns)
    cells[layout.pilot] = PILOTS[symbol % len(PILOTS)]
    cells[~layout.free] = 1
    side = layout.mode.cell
    out = np.zeros((layout.mode.height, layout.mode.width), np.float32)
    out[: rows * side, : columns * side] = np.repeat(np.repeat(cells, side, 0), side, 1)
    return out


def image(
    pixels: npt.NDArray[np.float32], registration: Registration, shape: tuple[int, int],
    shift: tuple[float, float] = (0.0, 0.0),
) -> npt.NDArray[np.float32]:  # fmt: skip
    """Mean light on each camera pixel, of a panel pixel that is on: 1."""
    h, w = shape
    to_fine = np.array([[FINE, 0, (FINE - 1) / 2], [0, FINE, (FINE - 1) / 2], [0, 0, 1]], float)
    move = np.array([[1, 0, shift[0]], [0, 1, shift[1]], [0, 0, 1]], float)
    fine = cv2.warpPerspective(
        pixels, to_fine @ move @ registration.homography, (w * FINE, h * FINE),
        flags=cv2.INTER_NEAREST,
    )  # fmt: skip
    if registration.blur > 0:
        fine = cv2.GaussianBlur(fine, (0, 0), registration.blur * FINE)
    mean = fine.reshape(h, FINE, w, FINE).mean(axis=(1, 3))
    return np.asarray(mean, np.float32)


def make(
    layout: Layout,
    registration: Registration,
    timing: Timing,
    symbols: int,
    shape: tuple[int, int],
    *,
    known: npt.NDArray[np.bool_] | None = None,
    bits: npt.NDArray[np.bool_] | None = None,
    threshold: int = 1000,
    on: float = 1.4,
    background: float = 0.02,
    reset: str = "hard",
    gain: npt.NDArray[np.float64] | None = None,
    seed: int = 1,
) -> Scene:
    """`known` first, random symbols after it. on, background: thresholds a tick."""
    rng = np.random.Generator(np.random.Philox(key=seed))
    if bits is None:
        bits = rng.random((symbols, layout.cells)) < 0.5
    if known is not None:
        bits[: len(known)] = known[: len(bits)]
    ticks = int(np.ceil(timing.start(symbols, timing.rows) + 2))
    rows = np.arange(shape[0])
    light = np.zeros((ticks, *shape), np.float32)
    for n in range(symbols):
        begin = timing.start(n, rows)
        middle = float(timing.start(n + 0.5, timing.rows / 2))
        seen = image(panel(layout, bits[n], n), registration, shape, registration.shift(middle))
        for k in range(int(begin.min()), int(begin.max() + timing.period) + 2):
            if k < ticks:
                part = np.minimum(k + 1, begin + timing.period) - np.maximum(k, begin)
                light[k] += np.clip(part, 0, 1)[:, None].astype(np.float32) * seen
    charge = threshold * rng.random(shape, np.float32)
    planes = np.zeros((ticks, *shape), np.bool_)
    for k in range(ticks):
        mean = threshold * (background + on * light[k])
        mean = np.asarray(mean if gain is None else mean * gain, np.float32)
        charge += mean + np.sqrt(mean) * rng.standard_normal(shape, np.float32)
        planes[k] = charge >= threshold
        charge = np.where(planes[k], charge % threshold if reset == "residual" else 0, charge)
    return Scene(layout, registration, timing, bits, pack_planes(planes))
