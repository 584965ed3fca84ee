"""Pictures of a report, computed from a recorded stream."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from cosim.light.light import Box, Plane
from cosim.report.png import LARGEST_PICTURE, for_display
from cosim.spikes.viform import SpikeStream, count_spikes

WINDOWS = (1, 2, 5, 50, 200, 800)
"""Cycles of accumulation in figure 3 of Huang 2022."""
Grey = npt.NDArray[np.uint8]


def accumulation(stream: SpikeStream, window: int, white_rate: float, first: int = 0) -> Grey:
    """Picture of the spikes in `window` cycles from cycle `first` on, (H, W) uint8.

    White stands for the mean number of spikes of a white pixel in this window, and at least for one
    spike, so that a single cycle shows spikes as white points.
    """
    count = count_spikes(stream, first, first + window).astype(np.float32)
    return for_display(count / max(1.0, window * white_rate))


def busiest_box(change: Plane, side: int) -> Box:
    """The square with the largest sum. side: pixels, reduced if it does not fit."""
    import cv2

    height, width = change.shape
    side = min(side, height, width)
    sums = cv2.boxFilter(change, -1, (side, side), normalize=False, borderType=cv2.BORDER_CONSTANT)
    half = side // 2
    inside = sums[half : height - side + half + 1, half : width - side + half + 1]
    y, x = np.unravel_index(int(np.argmax(inside)), inside.shape)
    return (int(y), int(y) + side, int(x), int(x) + side)


def crop(image: npt.NDArray[np.uint8], box: Box) -> Grey:
    """The part of an image inside a box."""
    return np.ascontiguousarray(image[box[0] : box[1], box[2] : box[3]])


def enlarge(image: Grey, least: int = 360) -> Grey:
    """Enlarges small pictures by an integer factor. least: width in pixels to reach, unless the
    longer side would become longer than LARGEST_PICTURE."""
    times = max(1, min(math.ceil(least / image.shape[1]), LARGEST_PICTURE // max(image.shape)))
    return np.kron(image, np.ones((times, times), np.uint8)) if times > 1 else image


def mark_pixels(image: Grey, points: list[tuple[int, int, str]]) -> npt.NDArray[np.uint8]:
    """The image in colour, enlarged if small, with numbered circles at the points (row, column)."""
    import cv2

    large = enlarge(image, 800)
    times, (height, width) = large.shape[1] // image.shape[1], large.shape
    unit = max(height, width) / 1000
    radius, thick = round(9 * unit), max(1, round(2 * unit))
    font, size, dark, light = cv2.FONT_HERSHEY_SIMPLEX, 0.8 * unit, (30, 30, 30), (60, 200, 255)
    canvas = cv2.cvtColor(large, cv2.COLOR_GRAY2BGR)
    for n, (row, column, _) in enumerate(points, 1):
        y, x = (row * times + times // 2, column * times + times // 2)
        cv2.circle(canvas, (x, y), radius + thick, dark, thick, cv2.LINE_AA)
        cv2.circle(canvas, (x, y), radius, light, thick, cv2.LINE_AA)
        (wide, high), _ = cv2.getTextSize(str(n), font, size, thick)
        gap = radius + 3 * thick
        left = x + gap if x + gap + wide + thick < width else x - gap - wide
        base = min(max(y + high // 2, high + thick), height - thick - 1)
        corners = (left - thick, base - high - thick), (left + wide + thick, base + thick)
        cv2.rectangle(canvas, *corners, dark, cv2.FILLED)
        cv2.putText(canvas, str(n), (left, base), font, size, light, thick, cv2.LINE_AA)
    return np.asarray(canvas, np.uint8)
