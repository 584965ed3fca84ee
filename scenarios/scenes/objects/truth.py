"""Dense truth of a scene of plates: which plate a pixel shows, its depth, and where it goes.

All is computed for the centres of pixels. A pixel near an edge shows the light of two surfaces,
which do not stay together; it is marked, because its light is found nowhere at another instant.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from scenarios.scenes.objects import painting
from scenarios.scenes.objects.painting import Mask
from scenarios.scenes.objects.plate import CATEGORIES
from scenarios.scenes.objects.scene import Objects


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
