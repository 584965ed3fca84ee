"""Test charts in closed form: groups of bars, Landolt rings, grey steps, discs of light.

A shape is a signed distance in pixels. The reflectance of a pixel follows from the part of it that
lies in the shape, a linear ramp one pixel wide across the edge. This is exact for an edge along the
grid, and within 4 % of a pixel's area for any other. Lengths are relative to the shorter side of
the sheet.
"""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

Values = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]
Regions = tuple[Mask, Mask]
"""Pixels inside the largest light and dark bars of a chart, for contrast-to-noise ratios."""

PAPER, WHITE, BLACK = 0.5, 0.9, 0.02
"""Reflectances: grey card, barium sulphate paint and flock, rounded; assumed."""
STEPS: Final = 8
"""Number of grey steps."""
CHARTS: Final = ("night", "bars", "landolt", "steps", "discs")
"""Names of the charts; "night" has bars, rings and steps on one sheet."""

_BARS: Final = (0.05, 0.03, 0.02, 0.0125, 0.008)
"""Widths of a bar in the five groups."""
_NIGHT, _LARGE = 0.74, 0.95
"""Size of the groups of bars on the sheet with rings and steps, and on a sheet of their own."""
ASPECT: Final = 5
"""Length of a bar over its width (MIL-STD-150A)."""
_RINGS: Final = (0.16, 0.1, 0.06, 0.036)
"""Diameters of the rings. Gap and line are a fifth of the diameter (ISO 8596:2017)."""
_DISCS: Final = ((0.322, 0.42, 0.11), (0.70, 0.70, 0.07), (0.78, 0.25, 0.04), (0.25, 0.80, 0.05),
                 (0.55, 0.12, 0.02))  # fmt: skip
"""Row and column of the middle, radius. The largest disc lies in rows 101 to 228 of 512, the window
that the paper on the EMCCD (003 of `docs/paper.md`) uses for its largest spot."""


class _Sheet:
    """A plane of reflectances on which shapes are drawn."""

    def __init__(self, shape: tuple[int, int], ground: float) -> None:
        height, width = shape
        self.side = float(min(shape))
        self.rows = (np.arange(height) + 0.5 - (height - self.side) / 2)[:, None]
        self.columns = (np.arange(width) + 0.5 - (width - self.side) / 2)[None, :]
        self.plane = np.full(shape, ground)

    def lay(self, distance: Values, tone: float) -> None:
        """Draws a shape.

        Args:
            distance: (H, W) pixels beyond its edge, negative inside.
            tone: reflectance.
        """
        part = np.clip(0.5 - distance, 0, 1)
        self.plane += (tone - self.plane) * part

    def box(self, row: float, column: float, high: float, wide: float) -> Values:
        """Distance to a rectangle around a middle point."""
        s = self.side
        return np.asarray(
            np.maximum(
                np.abs(self.rows - row * s) - high * s / 2,
                np.abs(self.columns - column * s) - wide * s / 2,
            )
        )

    def disc(self, row: float, column: float, radius: float) -> Values:
        """Distance to a disc around a middle point."""
        s = self.side
        return np.asarray(np.hypot(self.rows - row * s, self.columns - column * s) - radius * s)


def _group(sheet: _Sheet, row: float, column: float, bar: float) -> None:
    """Three bars across and three along, each five widths long, on white."""
    sheet.lay(sheet.box(row, column + 3 * bar, 7 * bar, 13 * bar), WHITE)
    for n in (-1, 0, 1):
        sheet.lay(sheet.box(row, column + 2 * n * bar, 5 * bar, bar), BLACK)
        sheet.lay(sheet.box(row + 2 * n * bar, column + 6 * bar, bar, 5 * bar), BLACK)


def _bars(sheet: _Sheet, row: float, column: float, size: float) -> None:
    """All groups of bars, one below the other. size: scale of their lengths."""
    at = row
    for bar in _BARS:
        at += 4.2 * bar * size
        _group(sheet, at, column - 3 * bar * size, bar * size)
        at += 4.2 * bar * size


def _ring(sheet: _Sheet, row: float, column: float, size: float, turn: int) -> None:
    """A Landolt ring; its gap points right, down, left or up."""
    ring = np.maximum(sheet.disc(row, column, size / 2), -sheet.disc(row, column, size * 0.3))
    down, right = ((0, 1), (1, 0), (0, -1), (-1, 0))[turn % 4]
    # The gap reaches from the middle to beyond the ring, a fifth of the diameter wide.
    gap = sheet.box(
        row + down * size * 0.3, column + right * size * 0.3,
        size * (0.6 if down else 0.2), size * (0.6 if right else 0.2),
    )  # fmt: skip
    sheet.lay(np.maximum(ring, -gap), BLACK)


def _rings(sheet: _Sheet, row: float, column: float, size: float) -> None:
    """Rows of four rings each on white, one below the other."""
    at = row
    for n, ring in enumerate(_RINGS):
        wide = ring * size
        at += 0.65 * wide
        sheet.lay(sheet.box(at, column, 1.3 * wide, min(5.0 * wide, 0.94 * size)), WHITE)
        many = 3 if n == 0 else 4
        for m in range(many):
            _ring(sheet, at, column + (m - (many - 1) / 2) * 1.25 * wide, wide, m + n)
        at += 0.65 * wide


def _steps(sheet: _Sheet, row: float, high: float) -> None:
    """Grey steps side by side, each darker than the last by sqrt 2, starting at white."""
    wide = 0.92 / STEPS
    for n in range(STEPS):
        tone = WHITE * 2 ** (-n / 2)
        left = 0.04 + n * wide  # each extends to the right end of the row, so there are no seams
        sheet.lay(sheet.box(row, (left + 0.96) / 2, high, 0.96 - left), tone)


def draw(chart: str, shape: tuple[int, int]) -> Values:
    """Reflectance of a chart (one of CHARTS), (H, W) float64 in [0, 1]. shape: (H, W)."""
    sheet = _Sheet(shape, 0.0 if chart == "discs" else PAPER)
    if chart == "night":
        _bars(sheet, 0.0, 0.29, _NIGHT)
        _rings(sheet, 0.16, 0.755, 0.55)
        _steps(sheet, 0.89, 0.14)
    elif chart == "bars":
        _bars(sheet, 0.01, 0.5, _LARGE)
    elif chart == "landolt":
        _rings(sheet, 0.03, 0.5, 1.0)
    elif chart == "steps":
        _steps(sheet, 0.5, 0.8)
    else:
        for row, column, radius in _DISCS:
            sheet.lay(sheet.disc(row, column, radius), WHITE)
    return np.clip(sheet.plane, 0, 1)


def bar_width(chart: str, shape: tuple[int, int]) -> float | None:
    """Width of the largest bar in pixels; None for a chart without bars."""
    size = {"night": _NIGHT, "bars": _LARGE}.get(chart)
    return None if size is None else _BARS[0] * size * min(shape)


def regions(plane: Values) -> Regions:
    """Light and dark pixels of a picture: their reflectance differs from the maximum or minimum by
    at most a fiftieth of the range, and so does that of all pixels within two pixels, if there are
    such."""
    from scipy.ndimage import binary_erosion

    low, high = float(plane.min()), float(plane.max())
    near = 0.02 * (high - low)
    masks = []
    for mask in (plane >= high - near, plane <= low + near):
        inner = binary_erosion(mask, iterations=2)
        masks.append(inner if inner.any() else mask)
    return masks[0], masks[1]
