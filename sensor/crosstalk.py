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

from cosim.light import Plane, PlaneMap

__all__ = ["crosstalk_map", "side_share"]


def side_share(crosstalk: float) -> float:
    """Share a that goes to each side, where `crosstalk` (0 to 1) is what a pixel loses in all."""
    return (1 - math.sqrt(1 - crosstalk)) / 2


def _along(plane: Plane, share: np.float32, axis: int) -> Plane:
    """One step of the walk along an axis."""
    width = [(1, 1) if n == axis else (0, 0) for n in range(2)]
    wide = np.pad(plane, width, mode="edge")
    one, two = (wide[:-2], wide[2:]) if axis == 0 else (wide[:, :-2], wide[:, 2:])
    # A sum of differences: uniform light stays the same to the last bit.
    mixed = plane + share * ((one - plane) + (two - plane))
    return mixed.astype(np.float32, copy=False)


def crosstalk_map(crosstalk: float) -> PlaneMap:
    """The map from light on the pixels to light that each gathers. crosstalk: share of its light
    that a pixel loses to its eight neighbours, 0 to 1."""
    share = np.float32(side_share(crosstalk))
    return PlaneMap(lambda plane: _along(_along(plane, share, 0), share, 1), grow=1)
