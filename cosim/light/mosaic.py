"""A filter array on a plane of pixels, each with one of three colours, and images in colour from
it.

Light stays one plane: a scene in colour gives each pixel the signal of its own filter. The cells
repeat every two rows and columns (Bayer, US patent 3971065).

The missing colours of a pixel come from 5 x 5 neighbours by the linear filters of Malvar, He and
Cutler (ICASSP 2004), whose coefficients are whole sixteenths. They correct the mean of a colour's
neighbours by the Laplacian of the pixel's own colour, so colours are balanced to white first.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import numpy.typing as npt

FILTERS: Final = ("rggb", "bggr", "grbg", "gbrg")
"""Arrays by the colours of rows 0 and 1, columns 0 and 1."""
Values = npt.NDArray[np.float64]
Image = npt.NDArray[np.float32]
_GREEN: Final = ((0, 0, -2, 0, 0), (0, 0, 4, 0, 0), (-2, 4, 8, 4, -2), (0, 0, 4, 0, 0),
                 (0, 0, -2, 0, 0))  # fmt: skip
"""Green at a red or blue pixel, sixteenths."""
_BESIDE: Final = ((0, 0, 1, 0, 0), (0, -2, 0, -2, 0), (-2, 8, 10, 8, -2), (0, -2, 0, -2, 0),
                  (0, 0, 1, 0, 0))  # fmt: skip
"""Red (blue) at a green pixel whose neighbours in the row are red (blue)."""
_ACROSS: Final = ((0, 0, -3, 0, 0), (0, 4, 0, 4, 0), (-3, 0, 12, 0, -3), (0, 4, 0, 4, 0),
                  (0, 0, -3, 0, 0))  # fmt: skip
"""Red at a blue pixel, blue at a red one."""


@dataclass(frozen=True, eq=False)
class Mosaic:
    """A filter array and the response of its colours.

    Attributes:
        name: one of `FILTERS`.
        response: (3, 3), signal of a red, green and blue pixel (rows) for a scene of linear BT.709
            red, green and blue (columns), over that of a pixel without a filter under white.
    """

    name: str
    response: Values

    @property
    def white(self) -> float:
        """Signal of the brightest colour under white, over that of a pixel without a filter."""
        return float(self.response.sum(axis=1).max())

    @property
    def matrix(self) -> Values:
        """(3, 3) `response` with 1 for the brightest colour under white."""
        return self.response / self.white

    def colour(self, shape: tuple[int, ...]) -> npt.NDArray[np.intp]:
        """Colour of each pixel, (H, W): 0 red, 1 green, 2 blue."""
        cells = np.array(["rgb".index(letter) for letter in self.name]).reshape(2, 2)
        return np.tile(cells, (-(-shape[0] // 2), -(-shape[1] // 2)))[: shape[0], : shape[1]]

    def mixed(self, rgb: npt.NDArray[Any]) -> npt.NDArray[np.float32]:
        """Signal of each pixel, 1 for white in the brightest colour: (H, W) from (H, W, 3), linear
        red, green and blue."""
        weights = self.matrix.astype(np.float32)[self.colour(rgb.shape[:2])]
        return np.asarray(np.einsum("hwk,hwk->hw", weights, rgb), np.float32)

    def neutral(self, shape: tuple[int, ...]) -> npt.NDArray[np.float32]:
        """Signal of each pixel under white, (H, W)."""
        return self.matrix.sum(axis=1).astype(np.float32)[self.colour(shape)]


def balanced(mosaic: Mosaic, image: npt.ArrayLike) -> Image:
    """Red, green and blue of the camera, white = 1: (H, W, 3) from (H, W), whose scale is that of
    `Mosaic.mixed`."""
    import cv2

    plane = np.asarray(image, np.float32)
    colour = mosaic.colour(plane.shape)
    plane = plane / mosaic.neutral(plane.shape)

    def filtered(kernel: tuple[tuple[int, ...], ...], turned: bool = False) -> Image:
        taps = np.array(kernel, np.float32) / 16
        # A border that mirrors about the last pixel keeps the order of the colours.
        return np.asarray(
            cv2.filter2D(plane, -1, taps.T if turned else taps, borderType=cv2.BORDER_REFLECT_101)
        )

    green, beside, above, across = (
        filtered(_GREEN), filtered(_BESIDE), filtered(_BESIDE, turned=True), filtered(_ACROSS)
    )  # fmt: skip
    out = np.empty((*plane.shape, 3), np.float32)
    out[..., 1] = np.where(colour == 1, plane, green)
    for own in (0, 2):
        in_row = np.broadcast_to((colour == own).any(axis=1, keepdims=True), plane.shape)
        at_green = np.where(in_row, beside, above)
        out[..., own] = np.where(colour == own, plane, np.where(colour == 1, at_green, across))
    return out


def in_colour(mosaic: Mosaic, image: npt.ArrayLike) -> Image:
    """Linear BT.709 red, green and blue of the scene, (H, W, 3), white = 1, not clipped:
    `balanced`, then the inverse of the response."""
    camera = mosaic.response / mosaic.response.sum(axis=1, keepdims=True)
    inverse = np.linalg.inv(camera).astype(np.float32)
    return np.asarray(balanced(mosaic, image) @ inverse.T, np.float32)


def delta_e(image: Image, other: Image) -> Image:
    """Colour difference (CIE 1976, D65), (H, W), of two images of linear red, green and blue,
    clipped to 0 to 1."""
    import cv2

    lab, lab_other = (
        cv2.cvtColor(np.clip(x, 0, 1, dtype=np.float32), cv2.COLOR_LRGB2LAB) for x in (image, other)
    )
    return np.asarray(np.linalg.norm(lab - lab_other, axis=2), np.float32)
