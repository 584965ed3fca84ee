"""Frames that are no clip: a folder of pictures, an array of NumPy, or one picture of floats."""

from __future__ import annotations

import re
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from cosim import InputError, Plane
from cosim.light.mosaic import Mosaic
from scenarios.scenes.clips.clip import SRGB, Clip, transfer_curve
from scenarios.scenes.clips.fitted import Fit
from scenarios.scenes.clips.tiff import tiff_size
from scenarios.scenes.clips.timeline import Timeline

__all__ = ["Pictures", "array_clip", "open_clip", "shown"]

_KEPT: Final = 3
"""Frames in memory."""
_REMEMBERED: Final = 1 << 28
"""Bytes of the frames of an array that are kept as light, in place of being converted anew."""
_NUMBER: Final = re.compile(r"(\d+)")


def _in_order(name: str) -> list[tuple[int, str]]:
    """Key of a name, by which frame 10 comes after frame 9."""
    return [(int(part), "") if part.isdecimal() else (-1, part) for part in _NUMBER.split(name)]


def pictures_of(folder: Path) -> list[Path]:
    """The files of a folder in the order of their names, without hidden files."""
    files = [path for path in folder.iterdir() if path.is_file() and path.name[0] != "."]
    return sorted(files, key=lambda path: _in_order(path.name))


class Pictures:
    """Frames of equal size, by number, in any order; the form of `Clip`.

    Args:
        path: for messages.
        read: from the number of a frame to the frame on the pixels.
        frames: their number.
        size: (height, width) of a picture, its pixels.
        rate: frames/s, which several frames need.
        notes: to which `read` adds.
        kept: frames in memory.

    Attributes:
        notes: notes for the user.
        size: as given.
        rate: frame rate, 1/s; 0 for a still image.
        count: number of frames read so far.
        ended: whether all frames have been read.
        timeline: None: frames are evenly spaced.
    """

    timeline: Timeline | None = None

    def __init__(
        self, path: Path, read: Callable[[int], Plane], frames: int, size: tuple[int, int],
        rate: float | None, notes: list[str], kept: int = _KEPT,
    ) -> None:  # fmt: skip
        if frames > 1 and rate is None:
            raise InputError(
                "scene.frame_rate", f"given for {path}, whose {frames} frames have no times",
                "absent", "write --set scene.frame_rate='240 Hz'",
            )  # fmt: skip
        self._read, self._frames, self.size, self.notes = read, frames, size, notes
        self._planes: dict[int, Plane] = {}
        self._kept = kept
        self.rate = Fraction(repr(rate)) if frames > 1 else Fraction(0)
        self.count = 0
        self.frame(0)

    @property
    def ended(self) -> bool:
        return self.count == self._frames

    def frame(self, n: int) -> Plane | None:
        """Frame n, (H, W) float32, white = 1; None beyond the last."""
        if n >= self._frames:
            self.count = self._frames
            return None
        if n not in self._planes:
            while len(self._planes) >= self._kept:
                del self._planes[next(iter(self._planes))]  # the oldest
            self._planes[n] = self._read(n)
            self.count = max(self.count, n + 1)
        return self._planes[n]

    def last(self) -> Plane:
        """The last frame of those read."""
        plane = self.frame(self.count - 1)
        assert plane is not None
        return plane


def _array(path: Path, fit: Fit) -> npt.NDArray[Any]:
    """The array of a .npy file, not in memory."""
    try:
        values = np.load(path, mmap_mode="r", allow_pickle=False)
    except (OSError, ValueError, EOFError) as exc:
        raise fit.bad("not a .npy file of numbers") from exc
    if not isinstance(values, np.ndarray):  # an .npz with another name
        raise fit.bad("not a .npy file of one array")
    if not (values.dtype in (np.uint8, np.uint16) or np.issubdtype(values.dtype, np.floating)):
        raise fit.bad(f"values of {values.dtype}: uint8 or uint16 in sRGB, or floats, are accepted")
    if 0 in values.shape:
        raise fit.bad(f"no values in its shape {values.shape}")
    return values


def shown(values: npt.NDArray[Any], fit: Fit) -> Plane:
    """A picture of an array on the pixels: codes of sRGB, or floats of linear light."""
    if not np.issubdtype(values.dtype, np.integer):
        return fit.floats(np.asarray(values))
    curve = transfer_curve(SRGB, int(np.iinfo(values.dtype).max))
    return fit.floats(curve[np.asarray(values)])


def _from_array(
    path: Path, shape: tuple[int, int], mosaic: Mosaic | None, mixed: bool, rate: float | None
) -> Pictures:
    notes: list[str] = []
    fit = Fit(path, shape, mosaic, mixed, notes)
    values = _array(path, fit)
    if values.ndim not in (2, 3, 4) or (values.ndim == 4 and values.shape[3] != 3):
        raise fit.bad(f"shape {values.shape}: (H, W), (T, H, W) or (T, H, W, 3) are accepted")
    frames = values if values.ndim > 2 else values[None]
    size = frames.shape[1], frames.shape[2]
    fit.check_size(*size)
    return Pictures(path, lambda n: shown(frames[n], fit), len(frames), size, rate, notes)


def array_clip(
    frames: npt.NDArray[Any], shape: tuple[int, int], mosaic: Mosaic | None, rate: float
) -> Pictures:
    """Frames in memory on a grid: the light of the same array in a .npy file.

    Args:
        frames: (T, H, W) or (T, H, W, 3), uint8 or uint16 in sRGB, or floats of linear light.
        shape: (height, width) of the grid.
        mosaic: filter array on the pixels; None for one colour.
        rate: frames/s.
    """
    notes: list[str] = []
    fit = Fit(Path("frames"), shape, mosaic, True, notes)
    size = frames.shape[1], frames.shape[2]
    fit.check_size(*size)
    kept = min(len(frames), max(_KEPT, _REMEMBERED // (4 * shape[0] * shape[1])))
    return Pictures(
        Path("frames"), lambda n: shown(frames[n], fit), len(frames), size, rate, notes, kept
    )


def _from_folder(
    path: Path, shape: tuple[int, int], mosaic: Mosaic | None, mixed: bool, rate: float | None
) -> Pictures:
    notes: list[str] = []
    files = pictures_of(path)
    if not files:
        raise Fit(path, shape, mosaic, mixed, notes).bad("a folder without files")

    first = _one(files[0], shape, mosaic, mixed)
    size = first.size

    def read(n: int) -> Plane:
        part = _one(files[n], shape, mosaic, mixed) if n else first
        if part.rate:
            raise Fit(files[n], shape, mosaic, mixed, notes).bad(
                "several frames in a folder's file"
            )
        if part.size != size:
            raise Fit(files[n], shape, mosaic, mixed, notes).bad(
                f"{part.size[0]} x {part.size[1]} pixels where the first picture of its folder has "
                f"{size[0]} x {size[1]}"
            )
        for note in part.notes:  # once, not for each picture
            text = note.replace(files[n].name, path.name)
            if text not in notes:
                notes.append(text)
        plane = part.frame(0)
        assert plane is not None
        return plane

    return Pictures(path, read, len(files), size, rate, notes)


def _one(path: Path, shape: tuple[int, int], mosaic: Mosaic | None, mixed: bool) -> Clip | Pictures:
    """A picture of a folder."""
    if path.suffix.lower() == ".npy":
        values = _array(path, Fit(path, shape, mosaic, mixed, []))
        if values.ndim == 3 and values.shape[2] == 3:  # here a picture in colour, not three frames
            notes: list[str] = []
            fit = Fit(path, shape, mosaic, mixed, notes)
            size = values.shape[0], values.shape[1]
            fit.check_size(*size)
            return Pictures(path, lambda n: shown(values, fit), 1, size, None, notes)
        return _from_array(path, shape, mosaic, mixed, None)
    return open_clip(path, shape, mosaic, mixed)


def open_clip(
    path: Path, shape: tuple[int, int], mosaic: Mosaic | None = None, mixed: bool = True,
    rate: float | None = None,
) -> Clip | Pictures:  # fmt: skip
    """The frames of a clip, a picture, a folder of pictures, or a .npy file on a grid.

    Args:
        path: a clip or picture of any format that PyAV or, for TIFF, OpenCV reads; a folder of
            pictures or .npy files, which are frames in the order of their names; or a .npy file:
            (H, W), (T, H, W) or (T, H, W, 3), of uint8 or uint16 in sRGB, or of floats of linear
            light with white = 1.
        shape: (height, width).
        mosaic: filter array on the pixels; None for one colour.
        mixed: whether each pixel takes the colour of its filter.
        rate: frames/s, which a folder and an array need; clips have their own.

    Raises:
        InputError: nothing that can be read, or frames without a rate.
    """
    if path.is_dir():
        return _from_folder(path, shape, mosaic, mixed, rate)
    if path.suffix.lower() == ".npy" and path.is_file():
        return _from_array(path, shape, mosaic, mixed, rate)
    notes: list[str] = []
    fit = Fit(path, shape, mosaic, mixed, notes)
    values = _tiff(path, fit) if path.suffix.lower() in (".tif", ".tiff") else None
    if values is None:
        return Clip(path, shape, mosaic, mixed)
    size = values.shape[0], values.shape[1]
    return Pictures(path, lambda n: fit.floats(values), 1, size, None, notes)


def _tiff(path: Path, fit: Fit) -> npt.NDArray[Any] | None:
    """Floats of a TIFF, (H, W) or (H, W, 3), of which FFmpeg reads only some; None for another
    file."""
    import cv2

    size = tiff_size(path) if path.is_file() else None
    if size is None:
        return None
    fit.check_size(*size)
    values = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    if values is None or not np.issubdtype(values.dtype, np.floating):
        return None
    return values if values.ndim == 2 else values[..., 2::-1]  # blue, green, red, and alpha
