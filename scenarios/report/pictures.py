"""The pictures of a report, made from the stream that was written."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from cosim import PS, Box, Plane, SpikeStream
from cosim.viform import count_spikes
from scenarios.png import for_display

__all__ = ["WINDOWS", "accumulation", "crop", "enlarge", "mark_pixels", "moving_box"]

WINDOWS = (1, 2, 5, 50, 200, 800)
"""Cycles that Huang 2022, figure 3 accumulates."""
Grey = npt.NDArray[np.uint8]


def accumulation(stream: SpikeStream, window: int, white_rate: float) -> Grey:
    """Spikes of the first `window` cycles, as a display shows them: (H, W) uint8.

    White is what white gives in that many cycles on average, and at least one spike, so that a
    single cycle shows its spikes as white points.
    """
    count = count_spikes(stream, 0, window).astype(np.float32)
    return for_display(count / max(1.0, window * white_rate))


def moving_box(box: Box, shape: tuple[int, int], least: int = 160) -> Box:
    """A near-square box around the part that moves, inside the plane, at least `least` pixels."""
    height, width = shape
    rows, columns = box[1] - box[0], box[3] - box[2]
    side = min(max(rows, columns, least), height, width)

    def place(low: int, high: int, size: int) -> int:
        return int(min(max((low + high - side) // 2, 0), size - side))

    y, x = place(box[0], box[1], height), place(box[2], box[3], width)
    return (y, y + side, x, x + side)


def busiest_box(before: Plane, after: Plane, side: int) -> Box:
    """The square where two planes differ most in sum."""
    import cv2

    change = np.abs(after - before)
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
    """Whole-number enlargement of small pictures, so that pixels stay pixels."""
    times = max(1, math.ceil(least / image.shape[1]))
    return np.kron(image, np.ones((times, times), np.uint8)) if times > 1 else image


def mark_pixels(image: Grey, points: list[tuple[int, int, str]]) -> npt.NDArray[np.uint8]:
    """The image in colour with numbered circles at (row, column)."""
    import cv2

    height, width = image.shape
    unit = max(height, width) / 1000
    canvas = cv2.cvtColor(image, cv2.COLOR_GRAY2BGR)
    for n, (row, column, _) in enumerate(points, 1):
        place = (column, row)
        radius, thick = max(2, round(9 * unit)), max(1, round(2 * unit))
        cv2.circle(canvas, place, radius + thick, (20, 20, 20), thick, cv2.LINE_AA)
        cv2.circle(canvas, place, radius, (60, 200, 255), thick, cv2.LINE_AA)
        size, text = 0.9 * unit, str(n)
        (wide, high), _ = cv2.getTextSize(text, cv2.FONT_HERSHEY_SIMPLEX, size, thick)
        gap = radius + 4 * thick
        x = column + gap if column + gap + wide < width else column - gap - wide
        anchor = (x, min(max(row + high // 2, high), height - 1))
        cv2.putText(
            canvas,
            text,
            anchor,
            cv2.FONT_HERSHEY_SIMPLEX,
            size,
            (20, 20, 20),
            3 * thick,
            cv2.LINE_AA,
        )
        cv2.putText(
            canvas, text, anchor, cv2.FONT_HERSHEY_SIMPLEX, size, (60, 200, 255), thick, cv2.LINE_AA
        )
    return np.asarray(canvas, np.uint8)


def seconds(ps: int) -> float:
    """Picoseconds as seconds."""
    return ps / PS
