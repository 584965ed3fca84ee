"""Which camera pixels see a cell, and what share of their light is the cell's.

The panel is cut into regions. Within a region a cell's image is one parallelogram, so the shares of
the pixels around it follow from where its centre falls between them: a table for each region and
sub-pixel place holds these pixels, the largest share first.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from link.layout import Layout
from link.timing import Registration

__all__ = ["LEAST", "PLACES", "SHARES", "CellImages", "Places", "cell_images"]

PLACES: Final = 8
"""Sub-pixel places along each axis."""
SHARES: Final = 16
"""Classes of share, evenly from 0 to 1."""
LEAST: Final = 0.35
"""Share below which a pixel is not looked at: its other cells disturb more than it tells. Chosen by
trials of 0.1 to 0.45 on 2 x 2 cells; what is best depends on cell, blur and light."""
_MOST: Final = 24
"""Pixels looked at for a cell."""
_FINE: Final = 16
"""Samples to a pixel where shares are integrated; even multiples of PLACES put them on places."""
_ACROSS: Final = 8
"""Regions along each axis, at most."""
_FEWEST: Final = 6
"""Cells along a region's side, at least."""
_SAME: Final = 1 / 128
"""Camera pixels to which sides of cells are told apart."""
_TALL: Final = 9
"""Cells that a strip of like cells is taken to reach to either side of one, together with it."""

Ints = npt.NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Places:
    """Pixels by region and place. count: (regions, PLACES, PLACES) int64, places in y, then x. dx,
    dy: from the pixel that the cell's centre lies in, (regions, PLACES, PLACES, most) int64. share:
    class of it, uint8, of the same shape, falling."""

    count: Ints
    dx: Ints
    dy: Ints
    share: npt.NDArray[np.uint8]


@dataclass(frozen=True, eq=False)
class CellImages:
    """Cells as the camera sees them without drift. x, y: of their centres, (cells,) float64.
    region: (cells,) int64. places: of their pixels. reach: how far those lie from the centre's, in
    pixels. regions: how many."""

    x: npt.NDArray[np.float64]
    y: npt.NDArray[np.float64]
    region: Ints
    places: Places
    reach: int
    regions: int


def _across(cells: int) -> int:
    return max(min(_ACROSS, cells // _FEWEST), 1)


def _coverage(
    a: npt.NDArray[np.float64], b: npt.NDArray[np.float64], blur: float, reach: int
) -> npt.NDArray[np.float64]:
    """Share of a pixel's light that is that of a parallelogram with sides a and b about 0, by the
    pixel's place: (2 reach _FINE + 1)^2 samples, in y, then x."""
    from scipy.ndimage import gaussian_filter, uniform_filter

    at = np.arange(-reach * _FINE, reach * _FINE + 1) / _FINE
    x, y = np.meshgrid(at, at)
    turned = a[0] * b[1] - a[1] * b[0]
    along_a = np.abs(x * b[1] - y * b[0]) / abs(turned)
    along_b = np.abs(y * a[0] - x * a[1]) / abs(turned)
    # Half of what stands exactly on a side, so that neighbours' shares add up to one.
    inside = np.where(along_a < 0.5, 1.0, 0.5 * np.isclose(along_a, 0.5))
    inside *= np.where(along_b < 0.5, 1.0, 0.5 * np.isclose(along_b, 0.5))
    if blur > 0:
        inside = gaussian_filter(inside, blur * _FINE, mode="constant", truncate=5)
    # A box of _FINE samples, its ends halved: centred, and its weights are those of a pixel.
    left = uniform_filter(inside, _FINE, mode="constant", origin=0)
    right = uniform_filter(inside, _FINE, mode="constant", origin=-1)
    both = uniform_filter(inside, _FINE, mode="constant", origin=(0, -1))
    other = uniform_filter(inside, _FINE, mode="constant", origin=(-1, 0))
    return np.asarray((left + right + both + other) / 4)


def _region_places(
    a: npt.NDArray[np.float64], b: npt.NDArray[np.float64], blur: float, tall: bool
) -> tuple[list[npt.NDArray[np.float64]], int]:
    """Rows (dx, dy, share) of pixels for each place, in y, then x, and their reach. a, b: sides of
    a cell."""
    extent = 0.5 * np.max(np.abs(a) + np.abs(b)) + 3 * blur + 1
    reach = int(np.ceil(extent)) + 1
    coverage = _coverage(a, b, blur, reach)
    share = _coverage(a, _TALL * b, blur, reach) if tall else coverage
    out = []
    step, d = _FINE // PLACES, np.arange(-reach + 1, reach)
    for qy in range(PLACES):
        for qx in range(PLACES):
            # the pixel at d lies at d - f of the centre, f the middle of its place
            fy, fx = ((q * step + step // 2) - _FINE // 2 for q in (qy, qx))
            at = np.ix_((reach + d) * _FINE - fy, (reach + d) * _FINE - fx)
            mine, known = coverage[at].ravel(), share[at].ravel()
            near = (d[:, None] ** 2 + d[None, :] ** 2).ravel()
            best = np.lexsort((near, -np.round(mine, 6)))
            many = max(np.count_nonzero(mine >= LEAST), 1)  # one, where cells are far too small
            best = best[: min(many, _MOST)]
            out.append(np.stack([d[best % len(d)], d[best // len(d)], known[best]], axis=1))
    return out, reach


def cell_images(
    layout: Layout,
    registration: Registration,
    cells: npt.NDArray[np.intp] | None = None,
    *,
    columns_alike: bool = False,
) -> CellImages:
    """cells: indices into the flattened (rows, columns), the data cells unless given.
    columns_alike: those above and below show the same (pilots), so that their light is its own."""
    (rows, columns), side = layout.shape, layout.mode.cell
    which = layout.data if cells is None else cells
    row, column = np.divmod(which, columns)
    x, y = registration.camera((column + 0.5) * side - 0.5, (row + 0.5) * side - 0.5)
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
            # Through more blur than a cell is long no cell is seen, and its tables have no end.
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
