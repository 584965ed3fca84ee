"""Detection of the panel's tags in an image of spike rates.

Tags are AprilTags 36h11 (Olson, "AprilTag: a robust and flexible visual fiducial system", ICRA
2011), detected by OpenCV. Its corners are accurate to some tenths of a pixel; `refining` then fits
the artwork of all tags together.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from link.layout import TAG_MODULES, Layout
from link.mode import Mode

Floats = npt.NDArray[np.float64]
_ENLARGED: Final = (1.0, 2.0, 3.0)
"""Factors by which the image is enlarged, in turn, until four tags are detected."""
_WHITES: Final = (0.995, 0.9999)
"""Quantiles of the rates taken as a tag's white, in turn: the tags of a small panel are too few
pixels for the first, which is then the grey of the data."""
_BRIGHTER: Final = 1.1
"""Ratio of the second white to the first from which the second is tried."""
_LARGEST: Final = 4096
"""Largest side of an enlarged image, pixels."""
LEAST_MODULE: Final = 1.6
"""Smallest module of a detectable tag, camera pixels. Measured on panels of 960 x 960 at random
positions and rotations, hard reset, blur of 0.35 camera pixels: all four tags in 12 of 12 images
from 1.6 on, in 10 at 1.5, 5 at 1.4, none at 1.3."""
_BLURRED: Final = 3.1
"""Smallest module over the standard deviation of a wider blur: through 0.7 camera pixels 4 of 4
images at 2.2 and none at 1.9, through 1.0 half at 3.0 and none at 2.6."""
_OFF: Final = 4.0
"""Largest distance of a corner from the homography, camera pixels or modules, before a tag is
rejected."""


@dataclass(frozen=True, eq=False)
class TagSearch:
    """Detected tags.

    Attributes:
        tags: (id, camera corners (4, 2)) by corner of the panel, 0 to 3.
    """

    tags: dict[int, tuple[int, Floats]]

    @property
    def mode(self) -> Mode | None:
        """Mode of the tags; None with fewer than four, or if they belong to no mode."""
        if len(self.tags) < 4:
            return None
        a, b, c, d = (self.tags[corner][0] for corner in range(4))
        try:
            return Mode.from_tags((a, b, c, d))
        except ValueError:
            return None


def dictionary() -> Any:
    """OpenCV's table of 36h11."""
    import cv2

    return cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)


def find_tags(rates: npt.NDArray[np.float32]) -> TagSearch:
    """Detects tags in an image of spike rates, (height, width)."""
    white, brighter = (float(n) for n in np.quantile(rates, _WHITES))
    best = _find(rates, white) if white > 0 else TagSearch({})
    if best.mode is None and brighter > _BRIGHTER * white:
        other = _find(rates, brighter)
        if len(other.tags) > len(best.tags) or other.mode is not None:
            return other
    return best


def _find(rates: npt.NDArray[np.float32], white: float) -> TagSearch:
    """Detects tags in the image with rates from `white` on clipped to white."""
    import cv2

    grey = np.clip(rates * (255.0 / white), 0, 255).astype(np.uint8)
    best = TagSearch({})
    for factor in _ENLARGED:
        if factor > 1 and factor * max(grey.shape) > _LARGEST:
            break
        for blur in (0.0, 0.6):
            image = cv2.GaussianBlur(grey, (0, 0), blur) if blur else grey
            if factor > 1:
                image = cv2.resize(image, None, fx=factor, fy=factor, interpolation=cv2.INTER_CUBIC)
            search = _detect(image, factor)
            if len(search.tags) > len(best.tags):
                best = search
            if best.mode is not None:
                return best
    return best


def _detect(image: npt.NDArray[Any], factor: float) -> TagSearch:
    import cv2

    setting = cv2.aruco.DetectorParameters()
    setting.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
    setting.minMarkerPerimeterRate = 0.02
    setting.adaptiveThreshWinSizeMax = 43
    ids: Any
    corners, ids, _ = cv2.aruco.ArucoDetector(dictionary(), setting).detectMarkers(image)
    tags: dict[int, tuple[int, Floats]] = {}
    if ids is None:
        return TagSearch(tags)
    sizes: dict[int, float] = {}
    for corner, number in zip(corners, ids.ravel(), strict=True):
        # In OpenCV pixel centres are integers; enlarged by f they are at f x + (f - 1) / 2.
        at = (corner.reshape(4, 2).astype(np.float64) + 0.5) / factor - 0.5
        size = float(np.linalg.norm(at - at.mean(0)))
        which = int(number) % 4
        if size > sizes.get(which, 0.0):  # of two tags for one corner, the larger
            sizes[which] = size
            tags[which] = (int(number), at)
    return TagSearch(tags)


def least_module(blur: float) -> float:
    """Smallest module of a detectable tag, camera pixels.

    Args:
        blur: standard deviation of the image's blur, camera pixels.
    """
    return max(LEAST_MODULE, _BLURRED * blur)


def tag_places(layout: Layout) -> list[tuple[int, int]]:
    """Panel (x, y) of the top left pixel of each tag, margin included."""
    mode, t = layout.mode, layout.tag
    return [(0, 0), (mode.width - t, 0), (mode.width - t, mode.height - t), (0, mode.height - t)]


def tag_corners(layout: Layout, corner: int) -> Floats:
    """Panel (x, y) of the corners of a tag's black border, (4, 2), clockwise from top left.

    They are edges of pixels, half a pixel from the centres.
    """
    x, y = tag_places(layout)[corner]
    low, high = layout.module - 0.5, layout.tag - layout.module - 0.5
    return np.array(
        [[x + low, y + low], [x + high, y + low], [x + high, y + high], [x + low, y + high]]
    )


def art_of(tag: int) -> npt.NDArray[np.bool_]:
    """A tag's modules, margin included, (TAG_MODULES, TAG_MODULES) bool, True for white."""
    import cv2

    out = np.ones((TAG_MODULES, TAG_MODULES), np.bool_)
    side = TAG_MODULES - 2
    out[1:-1, 1:-1] = cv2.aruco.generateImageMarker(dictionary(), tag, side) > 0
    return out


def fit_homography(search: TagSearch, layout: Layout) -> tuple[Floats, float] | None:
    """Homography from panel to camera by the corners of four tags, and its error.

    The error is the largest distance of a corner, camera pixels. None if there is no homography, or
    the panel is seen from behind.
    """
    import cv2

    panel = np.concatenate([tag_corners(layout, corner) for corner in range(4)])
    camera = np.concatenate([search.tags[corner][1] for corner in range(4)])
    # All corners of all tags together.
    out, _ = cv2.findHomography(panel, camera, 0)
    if out is None or not np.isfinite(out).all() or abs(out[2, 2]) < 1e-12:
        return None
    out = np.asarray(out / out[2, 2], np.float64)
    x, y, w = out @ np.vstack([panel.T, np.ones(len(panel))])
    if (w <= 0).any():
        return None
    off = float(np.hypot(x / w - camera[:, 0], y / w - camera[:, 1]).max())
    if np.linalg.det(out[:2, :2] - np.outer(out[:2, 2], out[2, :2])) <= 0:
        return None
    size = float(np.linalg.norm(camera[2] - camera[0])) / (TAG_MODULES - 2)
    return (np.asarray(out, np.float64), off) if off <= max(_OFF, size) else None
