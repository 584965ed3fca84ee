"""Dense truth of a scene of plates: which plate a pixel shows, its depth, and where it goes.

All is computed for the centres of pixels. A pixel near an edge shows the light of two surfaces,
which do not stay together; it is marked, because its light is found nowhere at another instant.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from scenarios.scenes.objects.painting import NOWHERE, edges, locate, window
from scenarios.scenes.objects.plate import CATEGORIES, Matrix
from scenarios.scenes.objects.scene import Objects

__all__ = ["HIDDEN", "MIXED", "SEEN", "Surfaces", "flow", "surfaces"]

SEEN: Final = 0
"""In an occlusion mask: the pixel shows one surface, which is seen at the other instant."""
MIXED: Final = 128
"""Its centre is seen at the other instant, but the pixel, or its place there, is at an edge."""
HIDDEN: Final = 255
"""Its centre is covered at the other instant, or outside the picture."""

HERE: Final = 2**-0.5
"""Distance from an edge within which a pixel may show two surfaces, pixels: half its diagonal."""
THERE: Final = 3 * 2**-0.5
"""The same for the four pixels between which a value is interpolated: a diagonal more."""

Mask = npt.NDArray[np.uint8]


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
            rows, columns = np.nonzero(self.labels == n + 1)
            if rows.size:
                x, y = columns.min(), rows.min()
                found[n] = x, y, columns.max() - x + 1, rows.max() - y + 1, rows.size
        return found


def _centres(shape: tuple[int, int]) -> tuple[Matrix, Matrix]:
    y, x = np.mgrid[0 : shape[0], 0 : shape[1]] + 0.5
    return x, y


def _distances(scene: Objects, n: int, homography: Matrix, x: Matrix, y: Matrix) -> Matrix:
    """Distance of points from plate n, pixels; NOWHERE for those far from it."""
    plate = scene.plates[n]
    out = np.full(x.shape, NOWHERE)
    y0, y1, x0, x1 = window(plate, homography, scene.shape, margin=4.0)
    near = (y >= y0) & (y <= y1) & (x >= x0) & (x <= x1)
    out[near] = edges(plate, homography, x[near], y[near])
    return out


def surfaces(scene: Objects, t: float) -> Surfaces:
    """What the pixels show at t, s."""
    x, y = _centres(scene.shape)
    labels = np.zeros(scene.shape, np.uint8)
    edge = np.zeros(scene.shape, np.bool_)
    homographies = scene.homographies(t)
    for n in range(1, len(scene.plates)):
        d = _distances(scene, n, homographies[n], x, y)
        labels[d <= 0] = n
        edge &= d > -HERE  # a plate hides the edges behind it
        edge |= np.abs(d) < HERE
    depth = np.empty(scene.shape, np.float32)
    for n, homography in enumerate(homographies):
        chosen = labels == n
        depth[chosen] = locate(homography, x[chosen], y[chosen])[2]
    return Surfaces(labels, depth, edge)


def flow(scene: Objects, a: float, b: float) -> tuple[npt.NDArray[np.float32], Mask]:
    """Optical flow from the instant a to the instant b, s, and the occlusion.

    Returns:
        (H, W, 2) float32, pixels to the right and down: where the point that is seen at the centre
        of the pixel at a is at b, also if it is covered there; and (H, W) uint8, SEEN, MIXED or
        HIDDEN.
    """
    x, y = _centres(scene.shape)
    before, after = scene.homographies(a), scene.homographies(b)
    seen = surfaces(scene, a)
    to = np.empty((2, *scene.shape))
    for n, (first, last) in enumerate(zip(before, after, strict=True)):
        chosen = seen.labels == n
        u, v, _ = locate(first, x[chosen], y[chosen])
        place = last @ np.stack([u, v, np.ones_like(u)])
        to[:, chosen] = place[:2] / place[2]
    hidden = np.zeros(scene.shape, np.bool_)
    mixed = seen.edge.copy()
    for n in range(1, len(scene.plates)):
        d = _distances(scene, n, after[n], *to)
        own = seen.labels == n
        mixed |= own & (d > -THERE)
        nearer = seen.labels < n  # plate n is before the plate that the pixel shows
        hidden |= nearer & (d <= 0)
        mixed |= nearer & (d < THERE)
    height, width = scene.shape
    hidden |= (to[0] < 0) | (to[0] >= width) | (to[1] < 0) | (to[1] >= height)
    mixed |= (to[0] < 0.5) | (to[0] > width - 0.5) | (to[1] < 0.5) | (to[1] > height - 0.5)
    occlusion = np.where(hidden, HIDDEN, np.where(mixed, MIXED, SEEN)).astype(np.uint8)
    return np.stack([to[0] - x, to[1] - y], axis=-1).astype(np.float32), occlusion


def categories(scene: Objects) -> list[str]:
    """Name of the category of each plate, the farthest first."""
    return [CATEGORIES[p.category] for p in scene.plates if p.category is not None]
