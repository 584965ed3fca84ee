"""Decoded frames as linear light: transfer curves, ranges of codes, primaries, and transparency.

White is 1. Clips are made for displays, so BT.709 and unspecified characteristics use the sRGB
curve. HDR clips state light above white: PQ in cd/m2, with white at 203 cd/m2, and HLG with white
at a signal of 0.75 (both Rec. ITU-R BT.2408-7, table 1). Colours of BT.2020 and P3 become those of
BT.709. Transparent parts are black.
"""

from __future__ import annotations

import re
from functools import lru_cache
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from scenarios.scenes.clips.fitted import CONVERTING, LUMINANCE, Fit

# Transfer characteristics: code point (ITU-T H.273, table 3) -> exponent of the display.
_POWER: Final = {4: 2.2, 5: 2.8, 8: 1.0}
_AS_SRGB: Final = {0, 1, 2, 3, 6, 7, 13, 14, 15}
SRGB: Final = 13
"""Transfer characteristic "sRGB" (ITU-T H.273, table 3)."""
GREY_OF_TIFF: Final = 4
"""Transfer characteristic that FFmpeg gives grey TIFF: a power of 2.2."""
_PQ: Final = 16
_HLG: Final = 18
_PQ_WHITE: Final = 203 / 10_000
"""Light of white as a share of the light of the highest PQ code (BT.2408-7)."""
_HLG_WHITE: Final = 0.75
"""Signal of white in HLG (BT.2408-7)."""

# Linear RGB of other primaries -> that of BT.709: code point (H.273, table 2) -> matrix.
_PRIMARIES: Final = {
    9: np.array(  # BT.2020 (Rec. ITU-R BT.2087-0, annex 1, inverted)
        [[1.6605, -0.5876, -0.0728], [-0.1246, 1.1329, -0.0083], [-0.0182, -0.1006, 1.1187]],
        np.float32,
    ),
    12: np.array(  # P3 with the white of BT.709, from the chromaticities of H.273, table 2
        [[1.2249, -0.2249, 0.0], [-0.0421, 1.0421, 0.0], [-0.0197, -0.0786, 1.0983]], np.float32
    ),
}
_MATRICES: Final = {0, 1, 2, 4, 5, 6, 7, 9}
"""Code points of the luma and chroma matrices that FFmpeg converts (H.273, table 4)."""
_LIMITED, _FULL = 1, 2
"""FFmpeg's numbers of the ranges of codes."""
# FFmpeg's 16-bit RGB is exact for RGB. Codes of limited range become white at 255 x 256 + 3; codes
# of full range, and grey of any, are shifted. Its 8-bit RGB is accurate to one code.
_WHITE_8, _WHITE_16, _WHITE_16_LIMITED = 255, 65535, 65283
_BLACK_OF_LIMITED, _WHITE_OF_LIMITED = 16, 235
"""Codes of black and white in limited range, 8 bits (BT.709-6, item 5.6)."""
_BAND: Final = 1 << 14
"""Pixels of a picture that are converted at once."""
_FLOATS: Final = re.compile(r"f(16|32)(le|be)?$")
"""The end of FFmpeg's names of pixel formats with floats."""


@lru_cache
def transfer_curve(code: int, white: int, black: int = 0) -> npt.NDArray[np.float32]:
    """Linear light of each code value, white = 1; (256,) up to a white of 255, else (65536,). The
    array is shared.

    Args:
        code: transfer characteristic (ITU-T H.273, table 3); unknown ones are taken as sRGB.
        white: code value of white, or of the highest light of PQ and HLG.
        black: code value of black.
    """
    codes = np.arange(256 if white <= _WHITE_8 else 65536)
    v = np.clip((codes - black) / (white - black), 0, 1)
    if code in _POWER:
        light = v ** _POWER[code]
    elif code == _PQ:  # SMPTE ST 2084, equation 4.1
        root = v ** (1 / 78.84375)
        light = (np.maximum(root - 0.8359375, 0) / (18.8515625 - 18.6875 * root)) ** (
            1 / 0.1593017578125
        ) / _PQ_WHITE
    elif code == _HLG:
        light = _hlg(v) / _hlg(np.array(_HLG_WHITE))
    else:  # IEC 61966-2-1, sRGB to linear
        light = np.where(v <= 0.04045, v / 12.92, ((v + 0.055) / 1.055) ** 2.4)
    return light.astype(np.float32)


def _hlg(v: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Light of the scene of an HLG signal (Rec. ITU-R BT.2100-2, table 5, inverse OETF)."""
    a, b, c = 0.17883277, 0.28466892, 0.55991073
    return np.where(v <= 0.5, v**2 / 3, (np.exp((v - c) / a) + b) / 12)


def is_of_floats(frame: Any) -> bool:
    """Whether the values of a frame are floats, which are linear light already."""
    return _FLOATS.search(frame.format.name) is not None


def float_values(frame: Any) -> npt.NDArray[Any]:
    """The floats of a frame, (H, W) or (H, W, 3). FFmpeg's own conversion would clip them."""
    name = frame.format.name
    if not name.startswith(("gbrpf16", "gbrapf16", "grayf16")):
        values: npt.NDArray[Any] = frame.to_ndarray()
        return values[..., :3] if values.ndim == 3 else values
    kind = np.dtype(np.float16).newbyteorder(">" if name.endswith("be") else "<")
    planes = [
        np.frombuffer(plane, kind).reshape(plane.height, -1)[:, : plane.width]
        for plane in frame.planes
    ]  # green, blue, red
    return planes[0] if len(planes) < 3 else np.stack([planes[2], planes[0], planes[1]], axis=2)


def _luminance(
    picture: npt.NDArray[np.uint8],
    curve: npt.NDArray[np.float32],
    weights: npt.NDArray[np.float32],
) -> npt.NDArray[np.float32]:
    """Linear luminance of an 8-bit picture, transparent parts black: (H, W) float32.

    OpenCV takes a fifth of numpy's time for it, and in bands that fit in the cache again a half.

    Args:
        picture: (H, W, 3 or 4) uint8, red, green, blue, and alpha.
        curve: (256,) float32, linear light of each code value.
        weights: (3,) float32, luminance of red, green and blue.
    """
    import cv2

    height, width, channels = picture.shape
    curves = np.stack([curve, curve, curve, np.arange(256, dtype=np.float32) / 255], axis=1)
    mixed = np.append(weights, np.float32(0))[None, :channels]
    luminance = np.empty((height, width), np.float32)
    step = max(_BAND // width, 1)
    for top in range(0, height, step):
        lit = cv2.LUT(picture[top : top + step], curves[None, :, :channels])
        band = luminance[top : top + step]
        band[...] = cv2.transform(lit, mixed)
        if channels == 4:
            band *= lit[..., 3]
    return luminance


class FrameConverter:
    """Converts frames of code values to linear light.

    Args:
        name: name of the file, for notes.
        coloured: whether colours are kept; otherwise light is luminance.
        fit: takes notes for the user, and refuses what FFmpeg does not convert.

    Attributes:
        most: highest light of the frames so far, white = 1.
    """

    def __init__(self, name: str, coloured: bool, fit: Fit) -> None:
        self._name, self._coloured, self._fit, self._note = name, coloured, fit, fit.note
        self.most = 1.0

    def light(self, frame: Any) -> npt.NDArray[np.float32]:
        """Linear light of a frame: (H, W), or (H, W, 3) in BT.709 if colours are kept.

        Raises:
            InputError: FFmpeg does not convert its form.
        """
        try:
            return self._converted(frame)
        except (OSError, ValueError) as exc:
            matrix = int(getattr(frame, "colorspace", 2))
            if matrix in _MATRICES:
                raise self._fit.undecodable(exc) from None
            told = f"colours by matrix {matrix} of ITU-T H.273, table 4, which are not converted"
            raise self._fit.bad(told) from None

    def _converted(self, frame: Any) -> npt.NDArray[np.float32]:
        """As `light`; raises what FFmpeg raises."""
        code = int(frame.color_trc or 2)
        if code in (_PQ, _HLG):
            kind = "PQ, white at 203 cd/m2" if code == _PQ else "HLG, white at a signal of 75 %"
            self._note(f"{self._name} is {kind} (ITU-R BT.2408)")
        elif code not in _POWER and code not in _AS_SRGB:
            self._note(f"transfer characteristics {code} (H.273) are treated as sRGB")
        parts = frame.format.components
        deep = max(part.bits for part in parts) > 8
        curve = self._curve(code, frame, parts[0].bits if deep else 8)
        matrix = _PRIMARIES.get(int(frame.color_primaries or 2))
        weights = LUMINANCE if matrix is None else LUMINANCE @ matrix
        clear = None
        if frame.format.name == "pal8" or any(part.is_alpha for part in parts):
            rgba = frame.to_ndarray(format="rgba", **CONVERTING)
            clear = rgba if rgba[..., 3].min(initial=255) < 255 else None
        if deep or self._coloured:
            light = curve[frame.to_ndarray(format="rgb48le" if deep else "rgb24", **CONVERTING)]
            if not self._coloured:
                light = light @ weights
            elif matrix is not None:
                light = np.maximum(light @ matrix.T, 0)
            if clear is not None:
                alpha = clear[..., 3] / np.float32(255)
                light *= alpha[..., None] if self._coloured else alpha
        else:
            picture = clear
            if picture is None:
                picture = frame.to_ndarray(format="rgb24", **CONVERTING)
            light = _luminance(picture, curve, weights)
        if clear is not None:
            self._note(f"{self._name}: transparent parts are black")
        return light

    def _curve(self, code: int, frame: Any, bits: int) -> npt.NDArray[np.float32]:
        """Curve of a frame with `bits` bits a code, as FFmpeg scales them; see `_WHITE_8`."""
        black, white = 0, _WHITE_8 if bits == 8 else _WHITE_16
        limited = frame.color_range == _LIMITED
        if len(frame.format.components) < 3 and frame.format.name != "pal8":
            if limited and frame.format.name.startswith("gray"):  # FFmpeg takes grey as full range
                black, white = _BLACK_OF_LIMITED, _WHITE_OF_LIMITED
                if bits > 8:
                    black, white = black << 8, white << 8
            elif bits > 8:
                white = ((1 << bits) - 1) << (16 - bits)
        elif bits > 8 and not frame.format.is_rgb:
            full = frame.color_range == _FULL or frame.format.name.startswith("yuvj")
            white = ((1 << bits) - 1) << (16 - bits) if full else _WHITE_16_LIMITED
        curve = transfer_curve(code, white, black)
        self.most = max(self.most, float(curve[-1]))
        return curve
