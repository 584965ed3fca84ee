"""The cells that each camera pixel sees, and their shares of its light.

It is the view of `geometry` from the other side: a detector that explains the spikes of a pixel by
all cells in its footprint needs their exact shares, not classes of them. The panel's image is taken
as one parallelogram to a cell in each region of the panel.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from link.detect.geometry import FINE, coverage
from link.layout import Layout
from link.timing import Registration

_LEAST: Final = 0.004
"""Share below which a cell is left out."""
_ACROSS: Final = 4
"""Regions along each axis."""
Values = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Footprints:
    """Cells of camera pixels.

    Attributes:
        row, column: (pixels,) int64 of the camera.
        cell: (pixels, seen) int64, index into the flattened (rows, columns) of cells, the largest
            share first; 0 with share 0 behind the last.
        share: (pixels, seen) float32, of the light that a pixel has with every cell on.
    """

    row: Ints
    column: Ints
    cell: Ints
    share: npt.NDArray[np.float32]


def _affine(registration: Registration, x: float, y: float, side: int) -> tuple[Values, Values]:
    """Sides (2,) of the image of a cell at panel (x, y), camera pixels."""
    u, v = registration.camera(
        np.array([x - side / 2, x + side / 2, x, x]), np.array([y, y, y - side / 2, y + side / 2])
    )
    return np.array([u[1] - u[0], v[1] - v[0]]), np.array([u[3] - u[2], v[3] - v[2]])


def _sampled(table: Values, reach: int, dx: Values, dy: Values) -> Values:
    """Share at positions of a pixel from a cell's centre, bilinearly."""
    x, y = (dx + reach) * FINE, (dy + reach) * FINE
    size = table.shape[0]
    inside = (x >= 0) & (y >= 0) & (x < size - 1) & (y < size - 1)
    x, y = np.where(inside, x, 0.0), np.where(inside, y, 0.0)
    i, j = x.astype(np.intp), y.astype(np.intp)
    a, b = x - i, y - j
    above = (1 - a) * table[j, i] + a * table[j, i + 1]
    below = (1 - a) * table[j + 1, i] + a * table[j + 1, i + 1]
    return np.where(inside, (1 - b) * above + b * below, 0.0)


def seen_by(
    layout: Layout, registration: Registration, row: Ints, column: Ints, blur: float,
    shift: tuple[float, float] = (0.0, 0.0),
) -> tuple[Ints, Values, npt.NDArray[np.bool_]]:  # fmt: skip
    """Cells around camera pixels.

    Args:
        layout, registration: cells, and their place in the image without drift.
        row, column: (pixels,) of the camera.
        blur: standard deviation of the image's blur, camera pixels.
        shift: shift of the image, camera pixels.

    Returns:
        cell: (pixels, n) int64, flat indices.
        share: (pixels, n) float64 of the pixel's light.
        free: (pixels, n) bool, whether it sees a cell, and this carries data or a pilot.
    """
    (rows, columns), side = layout.shape, layout.mode.cell
    inverse = np.linalg.inv(registration.homography)
    x, y, w = inverse @ np.stack([column - shift[0], row - shift[1], np.ones(len(row))])
    c, r = ((x / w + 0.5) / side - 0.5, (y / w + 0.5) / side - 0.5)  # in cells
    width, height = columns * side, rows * side
    middle = _affine(registration, width / 2, height / 2, side)
    least = min(float(np.hypot(*each)) for each in middle)
    around = int(np.ceil((0.5 + 3.5 * blur) / least + 0.5))
    step = np.arange(-around, around + 1)
    near_r, near_c = (np.rint(each).astype(np.int64) for each in (r, c))
    cell_r = near_r[:, None] + np.repeat(step, step.size)
    cell_c = near_c[:, None] + np.tile(step, step.size)
    u, v = registration.camera((cell_c + 0.5) * side - 0.5, (cell_r + 0.5) * side - 0.5)
    dx, dy = column[:, None] - (u + shift[0]), row[:, None] - (v + shift[1])
    region = np.clip(near_r * _ACROSS // max(rows, 1), 0, _ACROSS - 1) * _ACROSS + np.clip(
        near_c * _ACROSS // max(columns, 1), 0, _ACROSS - 1
    )
    share = np.zeros(dx.shape)
    for n in np.unique(region):
        at = region == n
        below, right = divmod(int(n), _ACROSS)
        a, b = _affine(
            registration, (right + 0.5) / _ACROSS * width, (below + 0.5) / _ACROSS * height, side
        )
        extent = 0.5 * np.max(np.abs(a) + np.abs(b)) + 4 * blur + 1
        reach = int(np.ceil(extent)) + 1
        share[at] = _sampled(coverage(a, b, blur, reach), reach, dx[at], dy[at])
    inside = (cell_r >= 0) & (cell_r < rows) & (cell_c >= 0) & (cell_c < columns)
    share = np.where(inside, share, 0.0)
    cell = np.where(inside, cell_r * columns + cell_c, 0)
    seen = share >= _LEAST
    share = np.where(seen, share, 0.0)
    free = layout.free.ravel()[cell] & seen
    return cell, share, free


def footprints(
    layout: Layout, registration: Registration, shape: tuple[int, int], blur: float,
    shift: tuple[float, float], most: int,
) -> Footprints:  # fmt: skip
    """Footprints of all camera pixels that see data or pilots.

    Args:
        layout, registration, blur, shift: layout, registration, blur and shift as for `seen_by`.
        shape: (height, width) of the camera.
        most: largest number of cells of a pixel.
    """
    rows, columns = (n.ravel() for n in np.indices(shape))
    kept = []
    for part in np.array_split(np.arange(rows.size), max(rows.size // 50_000, 1)):
        cell, share, free = seen_by(layout, registration, rows[part], columns[part], blur, shift)
        order = np.argsort(-share, axis=1, kind="stable")[:, :most]
        cell, share = np.take_along_axis(cell, order, 1), np.take_along_axis(share, order, 1)
        cell[share == 0] = 0
        sees = free.any(axis=1)
        kept.append((rows[part][sees], columns[part][sees], cell[sees], share[sees]))
    row, column, cell, share = (np.concatenate(each) for each in zip(*kept, strict=True))
    return Footprints(row.astype(np.int64), column.astype(np.int64), cell, share.astype(np.float32))
