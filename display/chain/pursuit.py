"""The velocity along the rows that a pursuing eye follows in a scene.

A scene may provide the velocity (`Source.pursuit`). Otherwise it is measured on the true light at
three instants in the middle of the run. Phase correlation compares, tile by tile, the change from
the first to the second instant with the change from the second to the third, so that static parts
do not count.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from cosim import PS, Plane
from cosim.light.source import Source

APART = 5 * 10**9
"""Time between the instants, ps."""
TILE = 128
"""Side of a tile, pixels: a shift above half of it cannot be measured."""
CHANGE = 1e-3
"""Minimum change of reflectance that counts as motion, RMS over a tile."""
LEAST = 0.1
"""Minimum shift that counts as motion, pixels."""
PEAK = 0.15
"""Minimum height of the correlation peak of a tile, 0 to 1, for its shift to be used (assumed)."""


class Pursuit(NamedTuple):
    """The motion that the pursuing eye follows.

    Attributes:
        velocity: velocity to the right, pixels/s; 0 for a static scene.
        note: note for the user on the origin of the velocity.
    """

    velocity: float
    note: str


def pursuit_of(source: Source, end: int, requested: float | None = None) -> Pursuit:
    """The pursuit of a scene.

    Args:
        source: the scene.
        end: end of the run, ps.
        requested: velocity in the scenario, pixels/s; None for that of the scene.
    """
    if requested is not None:
        return Pursuit(requested, f"the pursuing eye follows {requested:g} pixels/s")
    known = getattr(source, "pursuit", None)
    if known is not None:
        return Pursuit(
            float(known), f"the pursuing eye follows {known:g} pixels/s, the speed of the scene"
        )
    apart = min(APART, end // 4)
    one, two, three = (source.truth(end // 2 + n * apart) for n in (-1, 0, 1))
    shift = measured_shift(two - one, three - two)
    if shift is None:
        return Pursuit(
            0.0, "the pursuing eye does not move: the scene has no motion along the rows"
        )
    velocity = shift * PS / apart
    return Pursuit(
        velocity,
        f"the pursuing eye follows {velocity:.4g} pixels/s, measured on the true light over "
        f"{apart / PS * 1e3:.3g} ms in the middle of the run",
    )


def pursuit_without_scene(requested: float | None) -> Pursuit:
    """The pursuit of a stream whose scene is not known: at the speed that is given, pixels/s."""
    if requested:
        return Pursuit(requested, f"the pursuing eye follows {requested:g} pixels/s")
    return Pursuit(0.0, "the pursuing eye does not move: no scene is known")


def measured_shift(one: Plane, two: Plane) -> float | None:
    """The shift to the right from the change `one` to the change `two`, pixels: the median over
    tiles, weighted by the size of the change. None without motion."""
    import cv2  # the import takes 0.1 s

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
