"""The speed that an eye would follow in a scene, along the rows.

A scene that knows says so (`Source.pursuit`); else it is measured, tile by tile, from its true
light at three instants in the middle of the run: what changes from the first to the second and from
the second to the third, so that what keeps still counts for nothing.
"""

from __future__ import annotations

import numpy as np

from cosim import PS, Plane
from cosim.light.source import Source

__all__ = ["pursuit_speed", "shift_between"]

APART = 5 * 10**9
"""Picoseconds from an instant to the next."""
TILE = 128
"""Pixels of a tile's side: no shift above half of it can be told."""
CHANGE = 1e-3
"""Change of reflectance, root mean square over a tile, that is motion."""
LEAST = 0.1
"""Pixels of shift that are motion."""
LIKE = 0.15
"""Share of a tile's correlation in its peak (0 to 1) from which its shift is believed (assumed)."""


def pursuit_speed(source: Source, end: int) -> tuple[float, str]:
    """Pixels a second to the right, 0 where nothing moves, and a line that says where from.

    end: of the run, ps.
    """
    own = getattr(source, "pursuit", None)
    if own is not None:
        return float(own), f"the pursuing eye follows {own:g} pixels/s, as the scene says"
    apart = min(APART, end // 4)
    one, two, three = (source.truth(end // 2 + n * apart) for n in (-1, 0, 1))
    shift = shift_between(two - one, three - two)
    if shift is None:
        return 0.0, "the pursuing eye keeps still: no motion along the rows was found in the scene"
    speed = shift * PS / apart
    return speed, (
        f"the pursuing eye follows {speed:.4g} pixels/s, measured on the scene's own light over "
        f"{apart / PS * 1e3:.3g} ms in the middle of the run"
    )


def shift_between(one: Plane, two: Plane) -> float | None:
    """Pixels to the right by which a picture of change has moved from `one` to `two`: the median of
    its tiles, each with its size as weight. None where nothing moves."""
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
            change = float(np.sqrt(min(np.mean(a**2), np.mean(b**2))))
            if change < CHANGE:
                continue
            (along, _), like = cv2.phaseCorrelate(a, b, window)
            if like >= LIKE:
                shifts.append(along)
                weights.append(change * like)
    if not shifts:
        return None
    order = np.argsort(shifts)
    share = np.cumsum(np.array(weights)[order])
    middle = int(np.searchsorted(share, share[-1] / 2))
    shift = float(np.array(shifts)[order][middle])
    return shift if abs(shift) >= LEAST else None
