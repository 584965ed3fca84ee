"""A scene of plates: plates drawn from a seed, one in each of as many bands of depth, before a
background; its light at any instant; and its dense truth, which plate a pixel shows, its depth, and
where it goes.

A plate stays in its band at all times, so the nearer of two is always the same one.

The truth is computed for the centres of pixels. A pixel near an edge shows the light of two
surfaces, which do not stay together; it is marked, because its light is found nowhere at another
instant.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Final

import numpy as np
import numpy.typing as npt

from cosim import Box, Plane
from scenarios.scenes.drawing.analytic import spread_points
from scenarios.scenes.drawing.canvas import check_instant
from scenarios.scenes.objects import painting
from scenarios.scenes.objects.painting import Mask, Tables, paint, tabulate
from scenarios.scenes.objects.plate import CATEGORIES, FOCAL, Matrix, Plate, Wave

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
        count: number of plates, 0 to 64.
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


@dataclass(frozen=True)
class Objects:
    """An `AnalyticScene` of plates at several depths.

    Attributes:
        shape: (height, width), pixels.
        layout: seed of the plates, their motion and their textures.
        count: number of plates.
        pace: greatest speed of a centre, shorter sides of the picture a second.
    """

    shape: tuple[int, int]
    layout: int = 1
    count: int = 8
    pace: float = 8.0

    @cached_property
    def plates(self) -> tuple[Plate, ...]:
        """The background, then the plates, the farthest first."""
        side = min(self.shape)
        return arrange(
            self.layout, self.count, self.pace, self.shape[1] / side, self.shape[0] / side
        )

    @cached_property
    def tables(self) -> Tables:
        """The plates for compiled loops."""
        return tabulate(self.plates)

    def homographies(self, t: float) -> Matrix:
        """Homography of each plate at time t, s: (n, 3, 3)."""
        instant = check_instant(t)
        return np.stack([plate.homography(instant, self.shape) for plate in self.plates])

    def reflectance(self, t: float) -> Plane:
        """Reflectance at t, s, (H, W) float32 in [0, 1]."""
        image: Plane = paint(self.tables, self.homographies(t), self.shape)
        return image

    def speed(self) -> float:
        """Upper bound of the speed of any point in the picture, pixels/s."""
        return max(plate.speed(self.shape) for plate in self.plates)

    def moving(self, start: float, stop: float) -> Box:
        """The whole picture: its background moves."""
        if start == stop or self.pace == 0:
            return 0, 0, 0, 0
        return 0, self.shape[0], 0, self.shape[1]

    def points(self) -> list[tuple[int, int, str]]:
        return spread_points(self.shape)


@dataclass(frozen=True, eq=False)
class Surfaces:
    """What the pixels show at an instant.

    Attributes:
        labels: (H, W) uint8, 0 for the background, n for plate n.
        depth: (H, W) float32, m: distance along the optical axis.
        edge: (H, W) bool, pixels that may show two surfaces.
    """

    labels: Mask
    depth: npt.NDArray[np.float32]
    edge: npt.NDArray[np.bool_]

    def boxes(self, count: int) -> npt.NDArray[np.float64]:
        """(count, 5): x, y, width, height of the visible part of each plate, and its area, pixels;
        zeros for a plate that is not seen."""
        found = np.zeros((count, 5))
        for n in range(count):
            shown = self.labels == n + 1
            columns, rows = (np.flatnonzero(shown.any(axis)) for axis in (0, 1))
            if rows.size:
                x, y = columns[0], rows[0]
                area = np.count_nonzero(shown)
                found[n] = x, y, columns[-1] - x + 1, rows[-1] - y + 1, area
        return found


def surfaces(scene: Objects, t: float) -> Surfaces:
    """What the pixels show at t, s."""
    return Surfaces(*painting.surfaces(scene.tables, scene.homographies(t), scene.shape))


def flow(
    scene: Objects, a: float, b: float, seen: Surfaces | None = None
) -> tuple[npt.NDArray[np.float32], Mask]:
    """Optical flow from the instant a to the instant b, s, and the occlusion.

    Args:
        scene: the scene.
        a, b: the instants, s.
        seen: what the pixels show at a, if that is known.

    Returns:
        (H, W, 2) float32, pixels to the right and down: where the point that is seen at the centre
        of the pixel at a is at b, also if it is covered there; and (H, W) uint8, SEEN, MIXED or
        HIDDEN.
    """
    seen = seen or surfaces(scene, a)
    before, after = scene.homographies(a), scene.homographies(b)
    return painting.flow(scene.tables, before, after, seen.labels, seen.edge)


def categories(scene: Objects) -> list[str]:
    """Name of the category of each plate, the farthest first."""
    return [CATEGORIES[p.category] for p in scene.plates if p.category is not None]
