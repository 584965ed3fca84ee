"""The speed that an eye would follow in a scene, along the rows.

A scene that knows says so (`Source.pursuit`); else it is measured from its true light at two
instants in the middle of the run, tile by tile.
"""

from __future__ import annotations

import numpy as np

from cosim import PS, Plane
from scenarios.scenes import Source

__all__ = ["pursuit_speed", "shift_between"]

APART = 5 * 10**9
"""Picoseconds between the two instants."""
TILE = 128
"""Pixels of a tile's side: no shift above half of it can be told."""
CHANGE = 1e-3
"""Change of reflectance, root mean square over a tile, that is motion."""
LIKE = 0.15
"""Share of a tile's correlation in its peak (0 to 1) from which its shift is believed (assumed)."""


def pursuit_speed(source: Source, end: int) -> tuple[float, str]:
    """Pixels a second to the right, 0 where nothing moves, and a line that says where from.

    end: of the run, ps.
    """
    own = getattr(source, "pursuit", None)
    if own is not None:
        return float(own), f"the pursuing eye follows {own:g} pixels/s, as the scene says"
    apart = min(APART, end // 2)
    begin = (end - apart) // 2
    shift = shift_between(source.truth(begin), source.truth(begin + apart))
    if shift is None:
        return 0.0, "the pursuing eye keeps still: nothing in the scene moves along the rows"
    speed = shift * PS / apart
    return speed, (
        f"the pursuing eye follows {speed:.4g} pixels/s, measured on the scene's own light over "
        f"{apart / PS * 1e3:.3g} ms in the middle of the run"
    )


def shift_between(one: Plane, two: Plane) -> float | None:
    """Pixels to the right by which what moves has moved from picture `one` to `two`: the median of
    its tiles, each with the change it shows as its weight. None where nothing moves."""
    import cv2

    height, width = one.shape
    rows, columns = min(TILE, height), min(TILE, width)
    window = cv2.createHanningWindow((columns, rows), cv2.CV_64F)
    shifts, weights = [], []
    for y in range(0, height - rows + 1, max(rows // 2, 1)):
        for x in range(0, width - columns + 1, max(columns // 2, 1)):
            a, b = (
                np.ascontiguousarray(p[y : y + rows, x : x + columns], np.float64)
                for p in (one, two)
            )
            change = float(np.sqrt(np.mean((b - a) ** 2)))
            if change < CHANGE:
                continue
            (along, _), like = cv2.phaseCorrelate(a - a.mean(), b - b.mean(), window)
            if like >= LIKE:
                shifts.append(along)
                weights.append(change * like)
    if not shifts:
        return None
    order = np.argsort(shifts)
    share = np.cumsum(np.array(weights)[order])
    middle = int(np.searchsorted(share, share[-1] / 2))
    return float(np.array(shifts)[order][middle])
