"""Optical cross-talk: light of a pixel that its neighbours gather.

One step of a random walk in either direction: a share a goes to each side, so the map is
[a, 1 - 2a, a] along rows and along columns, its transfer function (1 - 2a(1 - cos w)) for each, and
a pixel keeps (1 - 2a)^2 of its light. Where charge diffuses between pixels this is the least form
that keeps all light; a measured map of a chip (Estribeau and Magnan, Proc. SPIE 5251:315, 2004) has
the same nine numbers. Beyond the array the border goes on, as over dummy pixels.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from cosim.compute.cores import by_rows
from cosim.light.light import Box, Plane, PlaneMap

_LARGE: Final = 1 << 18
"""Pixels from which a plane is mapped on all cores."""


def side_share(crosstalk: float) -> float:
    """Share a that goes to each side, where `crosstalk` (0 to 1) is what a pixel loses in all."""
    return (1 - math.sqrt(1 - crosstalk)) / 2


def crosstalk_map(crosstalk: float) -> PlaneMap:
    """The map from light on the pixels to light that each gathers. crosstalk: share of its light
    that a pixel loses to its eight neighbours, 0 to 1."""
    from sensor.device.mixing import mix  # brings numba with it, which no other start need wait for

    share = np.float32(side_share(crosstalk))

    def part(plane: Plane, box: Box) -> Plane:
        y0, y1, x0, x1 = box
        out = np.empty((y1 - y0, x1 - x0), np.float32)
        by_rows(mix, y1 - y0, plane, share, y0, x0, out, least=_LARGE)
        return out

    return PlaneMap(lambda plane: part(plane, (0, plane.shape[0], 0, plane.shape[1])), 1, part)
