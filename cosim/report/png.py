"""Picture files with linear values for programs, or with the sRGB curve for display; and whether a
run makes any."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from functools import cache
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from cosim.errors import InputError
from cosim.files.atomic import atomic_write

Grey = npt.NDArray[np.uint8]
Levels = npt.NDArray[np.floating[Any]]
LARGEST_PICTURE: Final = 2000
"""Longer side of the pictures of a report, pixels; larger ones are reduced."""
_WANTED: ContextVar[bool] = ContextVar("pictures of a run", default=True)


@contextmanager
def pictures(wanted: bool) -> Iterator[None]:
    """Within it, in this thread, the images of a run are files as well, or are not."""
    before = _WANTED.set(wanted)
    try:
        yield
    finally:
        _WANTED.reset(before)


def pictures_wanted() -> bool:
    """Whether the images of the run that is made are files as well. Its figures of merit are
    measured all the same."""
    return _WANTED.get()


def to_linear_bytes(x: Levels, scale: float = 1.0) -> Grey:
    """round(255 clip(x / scale, 0, 1)) as (H, W) uint8, halves to even. scale: above 0."""
    return np.rint(255 * np.clip(x.astype(np.float64) / scale, 0, 1)).astype(np.uint8)


@cache
def _display_curve() -> Grey:
    """sRGB code of each 16-bit linear level, (65536,) uint8 (IEC 61966-2-1)."""
    v = np.arange(65536) / 65535
    curve = np.where(v <= 0.0031308, 12.92 * v, 1.055 * v ** (1 / 2.4) - 0.055)
    return np.rint(255 * curve).astype(np.uint8)


def for_display(x: Levels) -> Grey:
    """sRGB codes of linear light, white = 1, (H, W) uint8."""
    from cosim.report.codes import look_up  # imports numba, 0.4 s

    codes = np.empty(x.shape, np.uint8)
    curve = _display_curve()
    look_up(x.ravel(), x.dtype.type(len(curve) - 1), curve, codes.ravel())
    return codes


def coloured(rgb: Levels) -> Grey:
    """sRGB codes of linear red, green and blue, (H, W, 3), in the order that OpenCV encodes: blue,
    green, red."""
    return np.ascontiguousarray(for_display(rgb)[..., ::-1])


def encode(image: npt.NDArray[np.uint8], ending: str = ".png", quality: int = 75) -> bytes:
    """Bytes of a picture file.

    Args:
        ending: ".png" or ".jpg".
        quality: quality of a JPEG.
    """
    import cv2

    options = [cv2.IMWRITE_JPEG_QUALITY, quality] if ending == ".jpg" else []
    fine, data = cv2.imencode(ending, image, options)
    if not fine:
        raise RuntimeError(f"OpenCV could not encode a {image.shape} picture as {ending}")
    return bytes(data)


def reduced(image: npt.NDArray[np.uint8], longest: int = LARGEST_PICTURE) -> Any:
    """The picture with a longer side of at most `longest` pixels, by means over its pixels."""
    import cv2

    times = -(-max(image.shape[:2]) // longest)
    if times == 1:
        return image
    height, width = (max(1, n // times) for n in image.shape[:2])
    return cv2.resize(image, (width, height), interpolation=cv2.INTER_AREA)


def write_png(path: Path, image: Grey) -> None:
    """Writes an 8-bit PNG, grey or as of `coloured`, atomically. Raises InputError unless the name
    ends in .png."""
    if path.suffix.lower() != ".png":
        named = path.with_suffix(".png") if path.name else path / "image.png"
        raise InputError("--out", "a name ending in .png", str(path), f"try {named}")
    with atomic_write(path) as part:
        part.write_bytes(encode(image))


def write_linear_png(path: Path, x: Levels) -> None:
    """Writes linear light, white = 1, as 8-bit grey."""
    write_png(path, to_linear_bytes(x))
