"""Frames in memory, or from a generator, as a clip without loss in a file."""

from __future__ import annotations

from collections.abc import Iterable
from fractions import Fraction
from itertools import chain
from pathlib import Path
from typing import Any, Final

import av
import numpy as np
import numpy.typing as npt

from cosim import InputError

__all__ = ["write_clip"]

_LINEAR: Final = 8
"""Transfer characteristic "linear" (ITU-T H.273, table 3)."""
_RANGE: Final = 2
"""FFmpeg's number of the full range of code values."""
_WHITE: Final = 65535


def _codes(frame: npt.ArrayLike) -> tuple[npt.NDArray[Any], str]:
    """Code values of a frame, and their pixel format. Raises InputError."""
    values = np.asarray(frame)
    colour = values.ndim == 3 and values.shape[2] == 3
    if values.dtype == np.uint8 and (values.ndim == 2 or colour):
        return values, "bgr0" if colour else "gray"
    if values.ndim != 2 or not np.issubdtype(values.dtype, np.floating):
        raise InputError(
            "a frame", "(H, W) or (H, W, 3) uint8 in sRGB, or (H, W) float of linear light from "
            "0 to 1", f"{values.shape} {values.dtype}", "convert it",
        )  # fmt: skip
    low, high = (float(v) for v in (values.min(initial=0), values.max(initial=0)))
    if not (low >= 0 and high <= 1):  # NaN as well
        raise InputError(
            "a frame of floats", "linear light from 0 to 1, a share of white",
            f"{low:g} to {high:g}", "divide it by the light of white and set scene.illuminance",
        )  # fmt: skip
    return np.rint(values.astype(np.float64) * _WHITE).astype(np.uint16), "gray16le"


def write_clip(frames: Iterable[npt.ArrayLike], path: Path, frame_rate: float) -> int:
    """Writes frames as FFV1 in Matroska, which keeps each code value. The same frames give the same
    file.

    Args:
        frames: (H, W) or (H, W, 3) uint8, sRGB codes; or (H, W) float of linear light from 0 to 1,
            a share of white, kept to 1/65535. All have one shape and type.
        path: file to write.
        frame_rate: frames/s.

    Returns:
        The number of frames.

    Raises:
        InputError: no frame, or one of another kind, or the rate is no number above 0.
    """
    if not (np.isfinite(frame_rate) and frame_rate > 0):
        raise InputError("frame_rate", "frames/s above 0", f"{frame_rate}", "give another")
    if not isinstance(frames, Iterable):
        raise InputError("frames", "arrays (H, W)", type(frames).__name__, "give frames or a path")
    rest = iter(frames)
    if isinstance(frames, np.ndarray) and frames.ndim < 3:
        raise InputError(
            "frames", "an array (T, H, W) or (T, H, W, 3), or a list of frames", f"{frames.shape}",
            "give one frame as frames[None]",
        )  # fmt: skip
    first = next(rest, None)
    if first is None:
        raise InputError("the clip", "one frame or more", "none", "give frames")
    codes, form = _codes(first)
    count = 0
    # Without this flag the file holds random numbers, and a run of the same frames is another one.
    with av.open(str(path), "w", options={"fflags": "+bitexact"}) as container:
        rate = Fraction(repr(float(frame_rate))).limit_denominator(1_000_000)
        stream: Any = container.add_stream("ffv1", rate=rate)
        stream.height, stream.width = codes.shape[:2]
        stream.pix_fmt, stream.codec_context.color_range = form, _RANGE
        if form == "gray16le":
            stream.codec_context.color_trc = _LINEAR
        for each in chain([first], rest):
            values, other = _codes(each)
            if values.shape != codes.shape or other != form:
                raise InputError(
                    f"frame {count}", f"{codes.shape} {codes.dtype} as the first",
                    f"{values.shape} {values.dtype}", "make all frames alike",
                )  # fmt: skip
            picture = av.VideoFrame.from_ndarray(
                np.ascontiguousarray(values), "rgb24" if form == "bgr0" else form
            )
            container.mux(stream.encode(picture))
            count += 1
        container.mux(stream.encode())
    return count
