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
_XYZ: Final = np.array(
    [[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.0721750],
     [0.0193339, 0.1191920, 0.9503041]]
)  # fmt: skip
"""CIE XYZ (rows) of linear BT.709 red, green and blue with a white of D65 (IEC 61966-2-1)."""
_KNEE: Final = 6 / 29
"""Cube root of the ratio at which L* becomes linear (CIE 15)."""
_VIVID: Final = 25.0**7
"""Chroma, to the power 7, around which CIEDE2000 corrects a* and rotates blue."""
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

    @property
    def camera(self) -> Values:
        """(3, 3) `response` with 1 for white in every colour: red, green and blue of `balanced`
        (rows) for those of the scene (columns)."""
        return np.asarray(self.response / self.response.sum(axis=1, keepdims=True))

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
    inverse = np.linalg.inv(mosaic.camera).astype(np.float32)
    return np.asarray(balanced(mosaic, image) @ inverse.T, np.float32)


def delta_e(image: Image, other: Image) -> Image:
    """Colour difference (CIE 1976, D65), (H, W), of two images of linear red, green and blue,
    clipped to 0 to 1."""
    import cv2

    lab, lab_other = (
        cv2.cvtColor(np.clip(x, 0, 1, dtype=np.float32), cv2.COLOR_LRGB2LAB) for x in (image, other)
    )
    return np.asarray(np.linalg.norm(lab - lab_other, axis=2), np.float32)


def lab(rgb: npt.ArrayLike) -> Values:
    """CIE 1976 L*, a*, b* (..., 3) of linear BT.709 red, green and blue, white = 1, under D65
    (CIE 15)."""
    ratio = np.asarray(rgb, np.float64) @ (_XYZ / _XYZ.sum(axis=1, keepdims=True)).T
    root = np.where(ratio > _KNEE**3, np.cbrt(ratio), ratio / (3 * _KNEE**2) + 4 / 29)
    x, y, z = np.moveaxis(root, -1, 0)
    return np.stack([116 * y - 16, 500 * (x - y), 200 * (y - z)], axis=-1)


def delta_e_2000(one: npt.ArrayLike, two: npt.ArrayLike) -> Values:
    """Colour difference CIEDE2000 (ISO/CIE 11664-6, all weights 1), (...), of colours in L*, a*,
    b*, (..., 3). Conventions for hues are those of Sharma, Wu and Dalal (Color Res. Appl. 30:21,
    2005)."""
    (l1, a1, b1), (l2, a2, b2) = (
        np.moveaxis(np.asarray(each, np.float64), -1, 0) for each in (one, two)
    )
    vivid = (0.5 * (np.hypot(a1, b1) + np.hypot(a2, b2))) ** 7
    stretch = 1.5 - 0.5 * np.sqrt(vivid / (vivid + _VIVID))
    a1, a2 = a1 * stretch, a2 * stretch
    c1, c2 = np.hypot(a1, b1), np.hypot(a2, b2)
    h1, h2 = (np.degrees(np.arctan2(b, a)) % 360 for a, b in ((a1, b1), (a2, b2)))
    grey = c1 * c2 == 0  # a grey has no hue: that of the other colour counts
    turn = h2 - h1
    apart = np.abs(turn) > 180
    turn = np.where(grey, 0.0, np.where(apart, turn - np.copysign(360.0, turn), turn))
    total = h1 + h2
    around = np.where(apart, np.where(total < 360, total + 360, total - 360), total)
    hue = np.where(grey, total, around / 2)
    light, chroma = 0.5 * (l1 + l2) - 50, 0.5 * (c1 + c2)

    def wave(times: int, shift: float) -> Values:
        return np.asarray(np.cos(np.radians(times * hue + shift)))

    waves = 1 - 0.17 * wave(1, -30) + 0.24 * wave(2, 0) + 0.32 * wave(3, 6) - 0.2 * wave(4, -63)
    d_light = (l2 - l1) / (1 + 0.015 * light**2 / np.sqrt(20 + light**2))
    d_chroma = (c2 - c1) / (1 + 0.045 * chroma)
    d_hue = 2 * np.sqrt(c1 * c2) * np.sin(np.radians(turn / 2)) / (1 + 0.015 * chroma * waves)
    blue = np.radians(60 * np.exp(-(((hue - 275) / 25) ** 2)))
    rotated = -2 * np.sqrt(chroma**7 / (chroma**7 + _VIVID)) * np.sin(blue)
    squares = d_light**2 + d_chroma**2 + d_hue**2 + rotated * d_chroma * d_hue
    return np.asarray(np.sqrt(np.maximum(squares, 0.0)))


def fitted_matrix(seen: npt.ArrayLike, true: npt.ArrayLike) -> Values:
    """The (3, 3) matrix that maps colours as a camera sees them to the true ones with the least sum
    of squares, and white to white. seen, true: (n, 3), white = 1."""
    from_white = np.asarray(seen, np.float64) - 1, np.asarray(true, np.float64) - 1
    # A row of weights that add up to 1 keeps white, and so does any map of distances from white.
    edges = from_white[0][:, :2] - from_white[0][:, 2:]
    found = np.empty((3, 3))
    for row in range(3):
        goal = from_white[1][:, row] - from_white[0][:, 2]
        weights = np.linalg.lstsq(edges, goal, rcond=None)[0]
        found[row] = [*weights, 1 - weights.sum()]
    return found
