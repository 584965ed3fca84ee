"""Optical cross-talk: light of a pixel that its neighbours gather.

One step of a random walk in either direction: a share a goes to each side, so the map is
[a, 1 - 2a, a] along rows and along columns, its transfer function (1 - 2a(1 - cos w)) for each, and
a pixel keeps (1 - 2a)^2 of its light. Where charge diffuses between pixels this is the least form
that keeps all light; a measured map of a chip (Estribeau and Magnan, Proc. SPIE 5251:315, 2004) has
the same nine numbers. Beyond the array the border goes on, as over dummy pixels.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit, prange

from cosim.light import Box, Plane, PlaneMap

__all__ = ["crosstalk_map", "side_share"]


def side_share(crosstalk: float) -> float:
    """Share a that goes to each side, where `crosstalk` (0 to 1) is what a pixel loses in all."""
    return (1 - math.sqrt(1 - crosstalk)) / 2


@njit(cache=True, parallel=True)
def _mixed(plane, share, y0, x0, made):  # type: ignore[no-untyped-def]
    """Fills `made` with rows from y0 and columns from x0 of the plane's image: a step of the walk
    along columns, then one along rows. Sums of differences: uniform light stays the same to the
    last bit."""
    height, width = plane.shape
    for r in prange(made.shape[0]):
        y = y0 + r
        above, below = max(y - 1, 0), min(y + 1, height - 1)
        columns = np.empty(made.shape[1] + 2, np.float32)
        for c in range(columns.size):
            x = min(max(x0 + c - 1, 0), width - 1)
            here = plane[y, x]
            columns[c] = here + share * ((plane[above, x] - here) + (plane[below, x] - here))
        for c in range(made.shape[1]):
            here = columns[c + 1]
            made[r, c] = here + share * ((columns[c] - here) + (columns[c + 2] - here))


def crosstalk_map(crosstalk: float) -> PlaneMap:
    """The map from light on the pixels to light that each gathers. crosstalk: share of its light
    that a pixel loses to its eight neighbours, 0 to 1."""
    share = np.float32(side_share(crosstalk))

    def part(plane: Plane, box: Box) -> Plane:
        y0, y1, x0, x1 = box
        made = np.empty((y1 - y0, x1 - x0), np.float32)
        _mixed(plane, share, y0, x0, made)
        return made

    return PlaneMap(lambda plane: part(plane, (0, plane.shape[0], 0, plane.shape[1])), 1, part)
