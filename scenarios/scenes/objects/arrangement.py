"""Plates drawn from a seed: one in each of as many bands of depth, before a background.

A plate stays in its band at all times, so the nearer of two is always the same one.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Final

import numpy as np

from scenarios.scenes.objects.plate import CATEGORIES, FOCAL, Plate, Wave

MOST: Final = 64
"""Largest number of plates."""
NEAR: Final = 2.0
"""Nearest depth of a plate, m (assumed, as all numbers of the layout)."""
FAR: Final = 9.0
"""Greatest depth of a plate, m."""
BACKGROUND: Final = 12.0
"""Depth of the background, m."""
SIZES: Final = (0.07, 0.17)
"""Semi-axes as they are seen, over the shorter side of the picture."""
SWING: Final = 0.15
"""Amplitude of the motion as it is seen, over the shorter side."""
FINEST: Final = 1 / 24
"""Shortest wave of a texture as it is seen, over the shorter side."""
COARSEST: Final = 1 / 4
WAVES: Final = 5
SHARE: Final = 0.5
"""Sum of the shares of the waves: the texture is tone (1 - SHARE) to tone (1 + SHARE)."""
TONES: Final = (0.2, 0.66)


def _waves(random: np.random.Generator, side: float) -> tuple[Wave, ...]:
    """Waves of a texture. side: metres on the plate that are seen as the shorter side."""
    shares = random.dirichlet(np.full(WAVES, 4.0)) * SHARE
    found = []
    for share in shares:
        length = FINEST * (COARSEST / FINEST) ** random.random() * side
        angle, phase = random.random(2) * 2 * math.pi
        found.append(
            Wave(math.cos(angle) / length, math.sin(angle) / length, float(phase), float(share))
        )
    return tuple(found)


@lru_cache(maxsize=8)
def arrange(layout: int, count: int, speed: float, wide: float, high: float) -> tuple[Plate, ...]:
    """The background and `count` plates, the farthest first.

    Args:
        layout: seed.
        count: number of plates, 0 to MOST.
        speed: greatest speed of a centre as it is seen, shorter sides of the picture a second.
        wide, high: sides of the picture over the shorter side.
    """
    random = np.random.Generator(np.random.Philox(key=layout))
    ratio = (FAR / NEAR) ** (1 / max(count, 1))
    plates = [_background(random, speed)]
    for n in range(count):
        far = FAR / ratio**n
        near = far / ratio
        plates.append(_plate(random, near, far, speed, wide, high))
    return tuple(plates)


def _background(random: np.random.Generator, speed: float) -> Plate:
    """A wall that moves slowly, as if the camera did."""
    side = BACKGROUND / FOCAL
    heading, phase, other = random.random(3) * 2 * math.pi
    rate = 0.2 * speed / SWING
    return Plate(
        category=None, a=1.0, b=1.0, power=2.0, petals=0, petal=0.0, x=0.0, y=0.0, z=BACKGROUND,
        swing=SWING * side, heading=float(heading), rate=rate, phase=float(phase),
        pump=0.01 * BACKGROUND, pump_phase=float(other), turn=0.0, spin=0.0, tilt=0.0,
        tilt_axis=0.0, tone=float(random.uniform(0.3, 0.5)), waves=_waves(random, side),
    )  # fmt: skip


def _plate(
    random: np.random.Generator, near: float, far: float, speed: float, wide: float, high: float
) -> Plate:
    """A plate whose depths lie between `near` and `far`."""
    z = 0.5 * (near + far)
    half = 0.5 * (far - near)
    side = z / FOCAL  # metres at this depth that are seen as the shorter side
    category = int(random.integers(len(CATEGORIES)))
    a, b = random.uniform(*SIZES, 2) * side
    kind = CATEGORIES[category]
    power = 6.0 if kind == "rectangle" else 2.0
    petals, petal = (int(random.integers(3, 7)), 0.2) if kind == "flower" else (0, 0.0)
    reach = (1 + petal) * max(a, b) * 2 ** max(0.5 - 1 / power, 0.0)
    # Three tenths of the band are for the change of depth, six for the slant.
    tilt = math.asin(min(0.6 * half / reach, math.sin(math.radians(40)))) * random.random()
    own = speed * random.uniform(0.4, 1.0)
    spin = random.choice([-1.0, 1.0]) * 0.5 * own * side / reach * random.random()
    turn, axis, heading, other = random.random(4) * 2 * math.pi
    return Plate(
        category=category, a=float(a), b=float(b), power=power, petals=petals, petal=petal,
        x=float(random.uniform(-0.4, 0.4) * wide * side),
        y=float(random.uniform(-0.4, 0.4) * high * side), z=z,
        swing=SWING * side, heading=float(heading), rate=own / SWING,
        # Not near a turning point at the start.
        phase=float(random.uniform(-0.25, 0.25) * math.pi + math.pi * random.integers(2)),
        pump=0.3 * half, pump_phase=float(other), turn=float(turn), spin=float(spin),
        tilt=float(tilt), tilt_axis=float(axis), tone=float(random.uniform(*TONES)),
        waves=_waves(random, side),
    )  # fmt: skip
