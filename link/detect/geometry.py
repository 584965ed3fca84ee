"""The camera pixels of each cell, and the share of their light that comes from the cell.

The panel is divided into regions. Within a region a cell's image is one parallelogram, so the
shares of the surrounding pixels depend only on the sub-pixel position of its centre. A table for
each region and position lists these pixels, the largest share first.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from link.layout import Layout
from link.timing import Registration

PLACES: Final = 8
"""Sub-pixel positions along each axis."""
SHARES: Final = 16
"""Classes of share, evenly from 0 to 1."""
LEAST: Final = 0.35
"""Share below which a pixel is not used: the other cells in it disturb more than it tells. Chosen
by trials of 0.1 to 0.45 on 2 x 2 cells; the optimum depends on cell, blur and light."""
_MOST: Final = 24
"""Largest number of pixels used for a cell."""
FINE: Final = 16
"""Samples to a pixel in the integration of shares; an even multiple of PLACES, so that samples lie
on the positions."""
_ACROSS: Final = 8
"""Largest number of regions along each axis."""
_FEWEST: Final = 6
"""Smallest number of cells along a region's side."""
_SAME: Final = 1 / 128
"""Resolution of the sides of cells, camera pixels: cells within it share a table."""
_TALL: Final = 9
"""Length of the strip of equal cells that a pilot column is modelled as, cells."""

Ints = npt.NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Places:
    """Pixels of a cell, by region and sub-pixel position (y, then x).

    Attributes:
        count: (regions, PLACES, PLACES) int64, number of pixels.
        dx, dy: (regions, PLACES, PLACES, most) int64, pixels from the one of the cell's centre.
        share: (regions, PLACES, PLACES, most) uint8, class of the share, descending.
    """

    count: Ints
    dx: Ints
    dy: Ints
    share: npt.NDArray[np.uint8]


@dataclass(frozen=True, eq=False)
class CellImages:
    """Images of cells in the camera, without drift.

    Attributes:
        x, y: (cells,) float64, centres, camera pixels.
        region: (cells,) int64.
        places: pixels of the images.
        reach: largest distance of a pixel from that of the centre.
        regions: number of regions.
    """

    x: npt.NDArray[np.float64]
    y: npt.NDArray[np.float64]
    region: Ints
    places: Places
    reach: int
    regions: int


def _across(cells: int) -> int:
    return max(min(_ACROSS, cells // _FEWEST), 1)


def coverage(
    a: npt.NDArray[np.float64], b: npt.NDArray[np.float64], blur: float, reach: int
) -> npt.NDArray[np.float64]:
    """Share of a pixel's light from a parallelogram about 0, by the pixel's position.

    Args:
        a, b: (2,) sides of the parallelogram, camera pixels.
        blur: standard deviation, camera pixels.
        reach: largest position, camera pixels.

    Returns:
        (2 reach FINE + 1)^2 samples, y then x.
    """
    from scipy.ndimage import gaussian_filter, uniform_filter

    at = np.arange(-reach * FINE, reach * FINE + 1) / FINE
    x, y = np.meshgrid(at, at)
    turned = a[0] * b[1] - a[1] * b[0]
    along_a = np.abs(x * b[1] - y * b[0]) / abs(turned)
    along_b = np.abs(y * a[0] - x * a[1]) / abs(turned)
    # A sample exactly on a side counts half, so that the shares of neighbours add up to one.
    inside = np.where(along_a < 0.5, 1.0, 0.5 * np.isclose(along_a, 0.5))
    inside *= np.where(along_b < 0.5, 1.0, 0.5 * np.isclose(along_b, 0.5))
    if blur > 0:
        inside = gaussian_filter(inside, blur * FINE, mode="constant", truncate=5)
    # A centred box of FINE samples with halved ends: the aperture of a pixel.
    left = uniform_filter(inside, FINE, mode="constant", origin=0)
    right = uniform_filter(inside, FINE, mode="constant", origin=-1)
    both = uniform_filter(inside, FINE, mode="constant", origin=(0, -1))
    other = uniform_filter(inside, FINE, mode="constant", origin=(-1, 0))
    return np.asarray((left + right + both + other) / 4)


def _region_places(
    a: npt.NDArray[np.float64], b: npt.NDArray[np.float64], blur: float, tall: bool
) -> tuple[list[npt.NDArray[np.float64]], int]:
    """Rows (dx, dy, share) of pixels for each sub-pixel position (y, then x), and their reach.

    Args:
        a, b: (2,) sides of a cell, camera pixels.
        blur: standard deviation, camera pixels.
        tall: whether the cells above and below show the same.
    """
    extent = 0.5 * np.max(np.abs(a) + np.abs(b)) + 3 * blur + 1
    reach = int(np.ceil(extent)) + 1
    own = coverage(a, b, blur, reach)
    share = coverage(a, _TALL * b, blur, reach) if tall else own
    out = []
    step, d = FINE // PLACES, np.arange(-reach + 1, reach)
    for qy in range(PLACES):
        for qx in range(PLACES):
            # The pixel at d lies at d - f from the centre, f the middle of the sub-pixel position.
            fy, fx = ((q * step + step // 2) - FINE // 2 for q in (qy, qx))
            at = np.ix_((reach + d) * FINE - fy, (reach + d) * FINE - fx)
            mine, known = own[at].ravel(), share[at].ravel()
            near = (d[:, None] ** 2 + d[None, :] ** 2).ravel()
            best = np.lexsort((near, -np.round(mine, 6)))
            many = max(np.count_nonzero(mine >= LEAST), 1)  # at least one, however small the cell
            best = best[: min(many, _MOST)]
            out.append(np.stack([d[best % len(d)], d[best // len(d)], known[best]], axis=1))
    return out, reach


def cell_centres(
    layout: Layout, registration: Registration, cells: npt.NDArray[np.intp] | None = None
) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """Centres (x, y) of cells without drift, camera pixels, (cells,) each. cells: as in
    `cell_images`."""
    row, column = np.divmod(layout.data if cells is None else cells, layout.shape[1])
    side = layout.mode.cell
    return registration.camera((column + 0.5) * side - 0.5, (row + 0.5) * side - 0.5)


def cell_images(
    layout: Layout,
    registration: Registration,
    cells: npt.NDArray[np.intp] | None = None,
    *,
    columns_alike: bool = False,
) -> CellImages:
    """Images of cells.

    Args:
        layout, registration: cells, and their place in the image.
        cells: indices into the flattened (rows, columns); None for the data cells.
        columns_alike: whether the cells above and below show the same (pilots), so that their light
            counts as the cell's.
    """
    (rows, columns), side = layout.shape, layout.mode.cell
    which = layout.data if cells is None else cells
    row, column = np.divmod(which, columns)
    x, y = cell_centres(layout, registration, cells)
    down, right = _across(rows), _across(columns)
    region = (row * down // rows) * right + column * right // columns
    places_of, reaches = [], []
    known: dict[bytes, tuple[list[npt.NDArray[np.float64]], int]] = {}
    for n in range(down * right):
        r, c = divmod(n, right)
        mx = (c + 0.5) / right * columns * side - 0.5
        my = (r + 0.5) / down * rows * side - 0.5
        u, v = registration.camera(
            np.array([mx - side / 2, mx + side / 2, mx, mx]),
            np.array([my, my, my - side / 2, my + side / 2]),
        )
        sides = np.round(np.array([[u[1] - u[0], v[1] - v[0]], [u[3] - u[2], v[3] - v[2]]]) / _SAME)
        key = sides.tobytes()
        if key not in known:
            # Blur wider than a cell hides the cell, and its tables would grow without limit.
            blur = min(registration.blur, float(np.hypot(*sides.T).max()) * _SAME)
            known[key] = _region_places(sides[0] * _SAME, sides[1] * _SAME, blur, columns_alike)
        places, reach = known[key]
        places_of.append(places)
        reaches.append(reach)
    most = max(len(place) for places in places_of for place in places)
    shape = (down * right, PLACES, PLACES)
    count = np.zeros(shape, np.int64)
    dx, dy = np.zeros((*shape, most), np.int64), np.zeros((*shape, most), np.int64)
    share = np.zeros((*shape, most), np.uint8)
    for n, places in enumerate(places_of):
        for q, place in enumerate(places):
            at = (n, *divmod(q, PLACES))
            count[at] = many = len(place)
            dx[at][:many], dy[at][:many] = place[:, 0], place[:, 1]
            share[at][:many] = np.clip(place[:, 2] * SHARES, 0, SHARES - 1)
    return CellImages(
        x, y, region.astype(np.int64), Places(count, dx, dy, share), max(reaches), down * right
    )
