"""The explorer of an imager's frames inside report.html: pictures, and the figures of each frame.

A page has every n-th frame and every n-th pixel, so that it stays small; the figures are those of
every frame.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from cosim.report.explorer import explorer, packed

FRAMES: Final = 96
"""Frames with a picture in a page, at most."""
VALUES: Final = 2_400_000
"""Pixel values in a page, at most; two bytes each, before compression."""
FIGURES: Final = 4000
"""Frames with figures in a page, at most."""

Frame = npt.NDArray[np.uint16]


@dataclass(frozen=True)
class FrameColumn:
    """One figure of each frame.

    Attributes:
        group: heading that it stands below.
        name: name of the figure, without spaces.
        unit: "" without one.
        values: value of each frame; None where it is not known.
    """

    group: str
    name: str
    unit: str
    values: Sequence[float | None]


def _evenly(count: int, most: int) -> list[int]:
    """At most `most` of the numbers 0 to count - 1, evenly spread, the ends among them."""
    if count <= most:
        return list(range(count))
    return sorted({round(n * (count - 1) / (most - 1)) for n in range(most)})


def _split(values: Frame) -> npt.NDArray[np.uint8]:
    """The low bytes of all values, then the high ones, which compress better apart."""
    raw = np.ascontiguousarray(values, "<u2").view(np.uint8).reshape(-1, 2)
    return np.ascontiguousarray(raw.T)


def frames_part(
    shapes: Sequence[tuple[int, int]], read: Callable[[int], Frame], full_scale: int,
    numbers: Sequence[int], ready_ms: Sequence[float], columns: Sequence[FrameColumn],
    texts: Mapping[str, str], *, unit: str = "DN", drawn: str = "exposure",
) -> str:  # fmt: skip
    """The HTML of the explorer.

    Args:
        shapes: rows and columns of each frame.
        read: values of the n-th frame; what it has beyond the shape is not shown.
        full_scale: largest possible value.
        numbers: numbers of the frames.
        ready_ms: instants at which the frames have left the imager, ms.
        columns: figures of the frames; among them `least` and `most`, the smallest and largest
            value, and `drawn`.
        texts: what a figure is, by its name.
        unit: unit of the values.
        drawn: name of the figure that is drawn first over the frames.
    """
    shown = _evenly(len(shapes), FRAMES)
    height, width = (max(shapes[n][k] for n in shown) for k in (0, 1))
    step = max(1, math.ceil(math.sqrt(len(shown) * height * width / VALUES)))
    off = step // 2  # the middle of each square that a pixel stands for
    size = -(-max(height - off, 1) // step), -(-max(width - off, 1) // step)
    values = np.zeros((len(shown), *size), np.uint16)
    sizes = []
    for target, n in zip(values, shown, strict=True):
        rows, wide = shapes[n]
        part = read(n)[off:rows:step, off:wide:step]
        target[: part.shape[0], : part.shape[1]] = part
        sizes.append(part.shape)
    told = sorted({*_evenly(len(shapes), FIGURES), *shown})
    place = {n: k for k, n in enumerate(told)}
    given: dict[str, Any] = {
        "count": len(shapes), "step": step, "off": off, "height": size[0], "width": size[1],
        "full": full_scale, "unit": unit, "drawn": drawn,
        "shown": [place[n] for n in shown], "sizes": sizes,
        "values": packed(_split(values)), "numbers": [numbers[n] for n in told],
        "ready": [ready_ms[n] for n in told],
        "columns": [
            {"group": one.group, "name": one.name, "unit": one.unit,
             "text": texts.get(one.name, ""), "values": [one.values[n] for n in told]}
            for one in columns
        ],
    }  # fmt: skip
    return explorer(given, "frames")
