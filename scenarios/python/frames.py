"""Frames in memory, or from a generator: checked, and as an array or a file."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Sequence
from itertools import chain
from numbers import Real
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from cosim import InputError
from cosim.errors import quote
from cosim.files.atomic import atomic_write


def rate_of(frame_rate: Any) -> float:
    """A frame rate as a float, frames/s. Raises InputError."""
    if isinstance(frame_rate, bool):
        raise InputError("frame_rate", "frames/s as a number", quote(frame_rate), "give a number")
    if isinstance(frame_rate, Real) and 0 < float(frame_rate) < np.inf:
        return float(frame_rate)
    must = "frames/s above 0" if isinstance(frame_rate, Real) else "frames/s as a number"
    raise InputError("frame_rate", must, quote(frame_rate), "give a number above 0")


def is_whole(value: Any) -> bool:
    """Whether a value is a whole number, and no truth value."""
    return isinstance(value, (int, np.integer)) and not isinstance(value, bool)


def check_white_rate(white_rate: Any) -> float:
    """A rate of white as a float, spikes a cycle. Raises InputError."""
    number = isinstance(white_rate, Real) and not isinstance(white_rate, bool)
    if number and 0 < float(white_rate) <= 1:
        return float(white_rate)
    raise InputError(
        "white_rate", "above 0 and at most 1 spike a cycle", quote(white_rate), "change it"
    )


def check_instants(instants: Sequence[int] | None) -> None:
    """Raises InputError for what are no numbers of cycles."""
    if instants is not None and not (
        isinstance(instants, (Sequence, np.ndarray))
        and len(instants) > 0
        and all(is_whole(n) for n in instants)
    ):
        raise InputError(
            "instants", "numbers of cycles, one or more", quote(instants), "change them"
        )


def check_frame(frame: npt.ArrayLike) -> npt.NDArray[Any]:
    """A frame as an array: (H, W) or (H, W, 3) uint8, sRGB codes; or (H, W) float of linear light
    from 0 to 1, a share of white. Raises InputError for another one."""
    try:
        values = np.asarray(frame)
    except (ValueError, TypeError) as exc:  # rows of several lengths, memory of another device
        raise InputError("a frame", "an array (H, W)", f"{exc}", "convert it") from None
    if np.ma.isMaskedArray(frame) and np.ma.getmask(frame).any():
        raise InputError("a frame", "an array without masked pixels", "masked", "fill them")
    colour = values.ndim == 3 and values.shape[2] == 3
    if 0 not in values.shape:
        if values.dtype == np.uint8 and (values.ndim == 2 or colour):
            return values
        if values.ndim == 2 and np.issubdtype(values.dtype, np.floating):
            _check_light(values)
            return values
    raise InputError(
        "a frame", "(H, W) or (H, W, 3) uint8 in sRGB, or (H, W) float of linear light from "
        "0 to 1", f"{values.shape} {values.dtype}", "convert it",
    )  # fmt: skip


def _check_light(values: npt.NDArray[Any]) -> None:
    """Raises InputError for floats outside 0 to 1, and for those that are no numbers."""
    plain = np.asarray(values)  # minima of masked arrays take no `initial`
    low, high = (float(v) for v in (plain.min(initial=0), plain.max(initial=0)))
    if low != low:
        given = f"{int(np.isnan(plain).sum())} of {plain.size} values NaN"
        raise InputError("a frame of floats", "light without NaN", given, "fill them")
    if not (low >= 0 and high <= 1):
        raise InputError(
            "a frame of floats", "linear light from 0 to 1, a share of white",
            f"{low:g} to {high:g}", "divide it by the light of white, and set the illuminance",
        )  # fmt: skip


def _checked(frames: Any) -> Iterator[npt.NDArray[Any]]:
    """The frames one by one, all of one shape and type. Raises InputError, also for no frame."""
    if isinstance(frames, (str, os.PathLike)):
        raise InputError(
            "frames", "arrays", f"the path {quote(frames)}", "use viform.film for files"
        )
    if not isinstance(frames, Iterable):
        raise InputError("frames", "arrays (H, W)", type(frames).__name__, "give frames")
    if isinstance(frames, np.ndarray) and frames.ndim < 3:
        raise InputError(
            "frames", "an array (T, H, W) or (T, H, W, 3), or a list of frames", f"{frames.shape}",
            "give one frame as frames[None]",
        )  # fmt: skip
    rest = iter(frames)
    first = next(rest, None)
    if first is None:
        raise InputError("the clip", "one frame or more", "none", "give frames")
    like = check_frame(first)
    for number, each in enumerate(chain([like], rest)):
        values = check_frame(each)
        if values.shape != like.shape or values.dtype != like.dtype:
            raise InputError(
                f"frame {number}", f"{like.shape} {like.dtype} as the first",
                f"{values.shape} {values.dtype}", "make all frames alike",
            )  # fmt: skip
        yield values


def array_of(frames: Any) -> npt.NDArray[Any]:
    """Frames as one array, (T, H, W) or (T, H, W, 3), see `check_frame`; an array of several frames
    is not copied. Raises InputError."""
    if isinstance(frames, np.ndarray) and frames.ndim > 2 and len(frames):
        check_frame(frames[0])
        if np.ma.isMaskedArray(frames):
            return array_of([*frames])
        if frames.dtype != np.uint8:
            _check_light(frames)
        return frames
    return np.stack(list(_checked(frames)))


def write_frames(frames: Any, path: Path) -> int:
    """Writes frames as one array of NumPy, one after another. The same frames give the same file.

    Args:
        frames: see `check_frame`; all have one shape and type.
        path: .npy file to write.

    Returns:
        The number of frames.

    Raises:
        InputError: no frame, or one of another kind; then no file is written.
    """
    count, header = 0, 0
    with atomic_write(path) as part, part.open("wb") as file:
        for values in _checked(frames):
            if count == 0:
                header = _write_header(file, values, 2**62)  # as long as that of any number
            file.write(np.ascontiguousarray(values).data)
            count += 1
        file.seek(0)
        _write_header(file, values, count, header)
    return count


def _write_header(file: Any, frame: npt.NDArray[Any], count: int, size: int = 0) -> int:
    """Writes the header of an array of frames, and returns its bytes. size: bytes to fill."""
    text = repr({
        "descr": np.lib.format.dtype_to_descr(frame.dtype), "fortran_order": False,
        "shape": (count, *frame.shape),
    })  # fmt: skip
    prefix = np.lib.format.magic(1, 0)
    size = size or -(-(len(prefix) + 2 + len(text) + 1) // 64) * 64
    body = text.encode("latin1").ljust(size - len(prefix) - 3) + b"\n"
    file.write(prefix + len(body).to_bytes(2, "little") + body)
    return size
