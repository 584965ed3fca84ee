"""The four AprilTags in the panel's corners, which give its position and its mode."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from link.layout import TAG_MODULES, Layout


@dataclass(frozen=True, eq=False)
class Tag:
    """A tag on the panel.

    Attributes:
        number: id in the family 36h11.
        place: rows and columns of panel pixels that it covers.
        bright: (side, side) bool, pixels that are on, its margin of one module included.
    """

    number: int
    place: tuple[slice, slice]
    bright: npt.NDArray[np.bool_]


def draw_tags(layout: Layout) -> tuple[Tag, ...]:
    """Tags at top left, top right, bottom right, bottom left; they are the same in every plane.

    The family is that of Olson, ICRA 2011, and Wang & Olson, IROS 2016.
    """
    import cv2

    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
    side, black = layout.tag, (TAG_MODULES - 2) * layout.module
    down, right = layout.mode.height - side, layout.mode.width - side
    tags = []
    for number, (top, left) in zip(
        layout.mode.tags, ((0, 0), (0, right), (down, right), (down, 0)), strict=True
    ):
        marker = np.asarray(cv2.aruco.generateImageMarker(dictionary, number, black)) > 127
        bright = np.pad(marker, layout.module, constant_values=True)
        tags.append(Tag(number, (slice(top, top + side), slice(left, left + side)), bright))
    return tuple(tags)
