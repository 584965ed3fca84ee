"""Charts of patches at rest: 24 colours, those of a ColorChecker by their published sRGB values,
and eight grey bars whose light steps from one level to another at one instant."""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

from cosim import Block, Light, Piece, Plane, seconds_to_ps
from cosim.light.mosaic import Image, Mosaic, delta_e_2000, fitted_matrix, lab

PATCHES: Final = (
    ("dark skin", (115, 82, 68)), ("light skin", (194, 150, 130)), ("blue sky", (98, 122, 157)),
    ("foliage", (87, 108, 67)), ("blue flower", (133, 128, 177)),
    ("bluish green", (103, 189, 170)), ("orange", (214, 126, 44)),
    ("purplish blue", (80, 91, 166)), ("moderate red", (193, 90, 99)), ("purple", (94, 60, 108)),
    ("yellow green", (157, 188, 64)), ("orange yellow", (224, 163, 46)), ("blue", (56, 61, 150)),
    ("green", (70, 148, 73)), ("red", (175, 54, 60)), ("yellow", (231, 199, 31)),
    ("magenta", (187, 86, 149)), ("cyan", (8, 133, 161)), ("white", (243, 243, 242)),
    ("neutral 8", (200, 200, 200)), ("neutral 6.5", (160, 160, 160)),
    ("neutral 5", (122, 122, 121)), ("neutral 3.5", (85, 85, 85)), ("black", (52, 52, 52)),
)  # fmt: skip
"""Name and 8-bit sRGB of each patch, row by row (X-Rite, "ColorChecker Classic", sRGB values)."""
ROWS, COLUMNS = 4, 6
_GAP: Final = 0.06
"""Black around a patch, as a share of its cell on each side."""
_LUMINANCE: Final = np.array([0.2126, 0.7152, 0.0722], np.float32)
_WHITE: Final = 18
"""Number of the white patch."""
_EDGE: Final = 4
"""Pixels at the edge of a patch that are left out: colours are filled in over two of them, and
cross-talk and light of other planes reach further."""
_FOREVER: Final = 2**62
BARS = 8


def linear(code: npt.ArrayLike) -> npt.NDArray[np.float64]:
    """Linear light of 8-bit sRGB codes (IEC 61966-2-1)."""
    v = np.asarray(code, np.float64) / 255
    return np.where(v <= 0.04045, v / 12.92, ((v + 0.055) / 1.055) ** 2.4)


def chart_matrix(mosaic: Mosaic) -> npt.NDArray[np.float64]:
    """The (3, 3) matrix from the colours of a camera, balanced to white, to linear BT.709 red,
    green and blue, fitted to the patches of the chart."""
    true = linear([codes for _, codes in PATCHES])
    return fitted_matrix(true @ mosaic.camera.T, true)


class ColourChart:
    """The chart as a `Source`.

    Args:
        shape: (height, width), pixels.
        illuminance: illuminance of the scene, lux.
        mosaic: filter array on the pixels; None for pixels that see luminance.

    Attributes:
        coloured: whether the light already is that behind the filters.
    """

    def __init__(
        self, shape: tuple[int, int], illuminance: float, mosaic: Mosaic | None = None
    ) -> None:
        self.shape, self.coloured = shape, mosaic is not None
        rgb = np.zeros((*shape, 3), np.float32)
        for number, (_, codes) in enumerate(PATCHES):
            y0, y1, x0, x1 = self.patch(number)
            rgb[y0:y1, x0:x1] = linear(codes)
        self._truth = rgb @ _LUMINANCE if mosaic is None else mosaic.mixed(rgb)
        white = illuminance * (1.0 if mosaic is None else mosaic.white)
        lux = self._truth * np.float32(white)
        self._light = Light((Piece(0, _FOREVER, lux, lux),))
        self.notes = ["24 patches of known colour, at rest"]
        self.degraded: list[str] = []

    def patch(self, number: int) -> tuple[int, int, int, int]:
        """Rows and columns of a patch: y0, y1, x0, x1."""
        row, column = divmod(number, COLUMNS)
        y, x = self.shape[0] / ROWS, self.shape[1] / COLUMNS
        return (
            round((row + _GAP) * y), round((row + 1 - _GAP) * y),
            round((column + _GAP) * x), round((column + 1 - _GAP) * x),
        )  # fmt: skip

    def step(self, data: None, block: Block) -> Light:
        return self._light

    def truth(self, ps: int) -> Plane:
        return self._truth

    def differences(self, image: Image) -> npt.NDArray[np.float64] | None:
        """Difference CIEDE2000 of each patch to its published colour, (24,), of an image in linear
        red, green and blue, (H, W, 3), as bright as makes the luminance of the white patch right.
        A patch is its mean without a border of `_EDGE`, negative light counting as none. None for
        patches too small, and without light."""
        found = []
        for number in range(len(PATCHES)):
            y0, y1, x0, x1 = self.patch(number)
            inside = image[y0 + _EDGE : y1 - _EDGE, x0 + _EDGE : x1 - _EDGE]
            if not inside.size:
                return None
            found.append(inside.mean(axis=(0, 1), dtype=np.float64))
        true, seen = linear([codes for _, codes in PATCHES]), np.array(found)
        bright = float(seen[_WHITE] @ _LUMINANCE)
        if bright <= 0:
            return None
        seen *= float(true[_WHITE] @ _LUMINANCE) / bright
        return delta_e_2000(lab(np.maximum(seen, 0.0)), lab(true))

    def points(self) -> list[tuple[int, int, str]]:
        places = [(self.patch(n), name) for n, (name, _) in enumerate(PATCHES)]
        low, right = (side - 1 for side in self.shape)
        return [
            (min((y0 + y1) // 2, low), min((x0 + x1) // 2, right), name)
            for (y0, y1, x0, x1), name in places
        ]


class StepSource:
    """Bar b of 8 has the reflectance (b + 1)/8. The step may be inside a latch cycle.

    Args:
        shape: (height, width), pixels.
        illuminance: illuminance at a level of 1, lux.
        before, after: levels of the light before and after the step.
        at: instant of the step, s.
        stop: end of the run, ps.
    """

    def __init__(
        self,
        shape: tuple[int, int],
        illuminance: float,
        before: float,
        after: float,
        at: float,
        stop: int,
    ) -> None:
        self.shape = shape
        bars = (np.arange(shape[1]) * BARS // shape[1] + 1) / BARS
        wedge = np.broadcast_to(bars.astype(np.float32), shape)
        self._levels = [np.ascontiguousarray(wedge * np.float32(x)) for x in (before, after)]
        self._at = seconds_to_ps(at)
        lux = [level * np.float32(illuminance) for level in self._levels]
        pieces = [Piece(self._at, 2**62, lux[1], lux[1])]
        if self._at > 0:
            pieces.insert(0, Piece(0, self._at, lux[0], lux[0]))
        self._light = Light(tuple(pieces))
        self.notes = [f"the light steps at {at * 1e3:g} ms, constant before and after"]
        self.degraded: list[str] = []
        if self._at >= stop:
            self.degraded.append("the run ends before the step of the light: lengthen duration")

    def step(self, data: None, block: Block) -> Light:
        return self._light

    def truth(self, ps: int) -> Plane:
        return self._levels[ps >= self._at]

    def points(self) -> list[tuple[int, int, str]]:
        height, width = self.shape
        return [
            (height // 2, (2 * b + 1) * width // (2 * BARS), f"bar {b + 1}") for b in range(BARS)
        ]
