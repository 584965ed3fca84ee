"""Speed that a pursuing eye follows in a scene, along the rows.

A scene that knows the speed provides it (`Source.pursuit`). Otherwise it is measured on the true
light at three instants in the middle of the run. Phase correlation compares, tile by tile, the
change from the first to the second instant with the change from the second to the third, so that
static parts do not count.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from cosim import PS, Plane
from cosim.light.source import Source

__all__ = ["Pursuit", "measured_shift", "pursuit_of"]

APART = 5 * 10**9
"""Picoseconds from an instant to the next."""
TILE = 128
"""Pixels of a tile's side: a shift above half of it cannot be measured."""
CHANGE = 1e-3
"""Change of reflectance, RMS over a tile, that counts as motion."""
LEAST = 0.1
"""Pixels of shift that count as motion."""
PEAK = 0.15
"""Share of a tile's correlation in its peak (0 to 1) from which its shift is used (assumed)."""


class Pursuit(NamedTuple):
    """What the pursuing eye follows.

    Attributes:
        velocity: pixels a second to the right; 0 if nothing moves.
        note: one line for the user that says where the velocity is from.
    """

    velocity: float
    note: str


def pursuit_of(source: Source, end: int, requested: float | None = None) -> Pursuit:
    """The pursuit of a scene.

    Args:
        source: the scene.
        end: of the run, ps.
        requested: velocity that the scenario asks for, None for the scene's.
    """
    if requested is not None:
        return Pursuit(requested, f"the pursuing eye follows {requested:g} pixels/s")
    known = getattr(source, "pursuit", None)
    if known is not None:
        return Pursuit(
            float(known), f"the pursuing eye follows {known:g} pixels/s, as the scene says"
        )
    apart = min(APART, end // 4)
    one, two, three = (source.truth(end // 2 + n * apart) for n in (-1, 0, 1))
    shift = measured_shift(two - one, three - two)
    if shift is None:
        return Pursuit(
            0.0, "the pursuing eye keeps still: no motion along the rows was found in the scene"
        )
    velocity = shift * PS / apart
    return Pursuit(
        velocity,
        f"the pursuing eye follows {velocity:.4g} pixels/s, measured on the scene's own light over "
        f"{apart / PS * 1e3:.3g} ms in the middle of the run",
    )


def measured_shift(one: Plane, two: Plane) -> float | None:
    """Pixels to the right by which a change has moved from `one` to `two`: the median over tiles,
    weighted by the size of the change. None if nothing moves."""
    import cv2  # 0.1 s of start-up

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
            (along, _), peak = cv2.phaseCorrelate(a, b, window)
            if peak >= PEAK:
                shifts.append(along)
                weights.append(change * peak)
    if not shifts:
        return None
    order = np.argsort(shifts)
    share = np.cumsum(np.array(weights)[order])
    middle = int(np.searchsorted(share, share[-1] / 2))
    shift = float(np.array(shifts)[order][middle])
    return shift if abs(shift) >= LEAST else None
