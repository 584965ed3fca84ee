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
from cosim.compute.cores import cores
from cosim.compute.memory import LITTLE
from cosim.light.mosaic import Mosaic
from scenarios.scenes.clips.clip import Clip
from scenarios.scenes.clips.fitted import Fit
from scenarios.scenes.clips.frame_converter import (
    GREY_OF_TIFF,
    SRGB,
    FrameConverter,
    transfer_curve,
)
from scenarios.scenes.clips.stills import Page, Still, decoded_still, still_in, tiff_pages
from scenarios.scenes.clips.timeline import Timeline

_KEPT: Final = 3
"""Frames in memory."""
_REMEMBERED: Final = 1 << 28
"""Bytes of the frames of an array that are kept as light, in place of being converted anew."""
_ANY_RATE: Final = 1.0
"""Rate for a file of a folder, by which one of several frames is told."""
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
        path: path for messages.
        read: map from the number of a frame to the frame on the pixels.
        frames: their number.
        size: (height, width) of a picture, its pixels.
        rate: frames/s, which several frames need.
        notes: notes to which `read` adds.
        kept: frames in memory.
        given: frames whose pixels are those of the grid, (T, H, W): uint8 codes, or float32 light
            from 0 to 1; None if they are not.

    Attributes:
        given: frames as given; `times` takes frames from them.
        notes: notes for the user.
        size: size as given.
        rate: frame rate, 1/s; 0 for a still image.
        count: number of frames read so far.
        ended: whether all frames have been read.
        timeline: times of the frames; None where they are evenly spaced.
    """

    timeline: Timeline | None = None

    def __init__(
        self, path: Path, read: Callable[[int], Plane], frames: int, size: tuple[int, int],
        rate: float | None, notes: list[str], kept: int = _KEPT,
        given: npt.NDArray[Any] | None = None,
    ) -> None:  # fmt: skip
        if frames > 1 and rate is None:
            raise InputError(
                "scene.frame_rate", f"given for {path}, whose {frames} frames have no times",
                "absent", "write --set scene.frame_rate='240 Hz'",
            )  # fmt: skip
        self._read, self._frames, self.size, self.notes = read, frames, size, notes
        self._planes: dict[int, Plane] = {}
        self._times: dict[tuple[int, np.float32, np.float32 | None], Plane] = {}
        self._kept, self.given = kept, given
        self.rate = Fraction(repr(rate)) if frames > 1 else Fraction(0)
        self.count = 0
        if given is None:
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
            while len(self._planes) >= self._kept:  # of many, those at the begin stay
                numbers = list(self._planes)
                del self._planes[numbers[-2 if self._kept > _KEPT else 0]]
            self._planes[n] = self._read(n)
            self.count = max(self.count, n + 1)
        return self._planes[n]

    def times(self, n: int, factor: np.float32, gain: np.float32 | None = None) -> Plane | None:
        """Frame n of `given` times a factor, and then a gain, as products of float32; None beyond
        the last."""
        assert self.given is not None
        if n >= self._frames:
            self.count = self._frames
            return None
        key = n, factor, gain
        if key not in self._times:
            if len(self._times) >= self._kept:
                self._times.popitem()
            if self.given.dtype == np.uint8:
                import cv2

                lit = cv2.LUT(self.given[n], self.table(factor, gain))
            else:
                lit = self.given[n] * factor
                if gain is not None:
                    lit *= gain
            self._times[key] = np.asarray(lit, np.float32)
            self.count = max(self.count, n + 1)
        return self._times[key]

    def table(self, factor: np.float32, gain: np.float32 | None) -> npt.NDArray[np.float32]:
        """Light of each code, (256,), or the factors of light, (2,): see `times`."""
        if self.given is None or self.given.dtype != np.uint8:
            return np.array([factor, 1.0 if gain is None else gain], np.float32)
        curve = transfer_curve(SRGB, 255) * factor
        return curve if gain is None else curve * gain

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
    native = values.dtype.newbyteorder("=")
    if not (native in (np.uint8, np.uint16) or np.issubdtype(values.dtype, np.floating)):
        raise fit.bad(f"values of {values.dtype}: uint8 or uint16 in sRGB, or floats, are accepted")
    if 0 in values.shape:
        raise fit.bad(f"no values in its shape {values.shape}")
    return values


def shown(
    values: npt.NDArray[Any], fit: Fit, code: int = SRGB,
    opaque: npt.NDArray[np.float32] | None = None,
) -> Plane:  # fmt: skip
    """A picture of an array on the pixels: codes of a transfer characteristic (ITU-T H.273), or
    floats of linear light. opaque: share of each pixel that is, (h, w); the rest is black."""
    light = np.asarray(values, values.dtype.newbyteorder("="))  # a file may have the other order
    if np.issubdtype(values.dtype, np.integer):
        curve = transfer_curve(code, int(np.iinfo(values.dtype).max))
        return fit.codes(light, curve, opaque)
    if opaque is not None:
        light = light * (opaque if light.ndim == 2 else opaque[..., None])
    return fit.floats(light)


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
        frames: (T, H, W) or (T, H, W, 3), uint8 or uint16 in sRGB, or floats of linear light, 0 to
            1.
        shape: (height, width) of the grid.
        mosaic: filter array on the pixels; None for one colour.
        rate: frames/s.
    """
    notes: list[str] = []
    fit = Fit(Path("frames"), shape, mosaic, True, notes)
    size = frames.shape[1], frames.shape[2]
    plain = frames.dtype in (np.uint8, np.float32) and frames.ndim == 3
    direct = plain and frames.dtype.isnative and size == shape and mosaic is None
    if not direct or size[0] * size[1] > LITTLE:  # pixels of the grid are not scaled
        fit.check_size(*size)
    kept = min(len(frames), max(_KEPT, _REMEMBERED // cores() // (4 * shape[0] * shape[1])))
    return Pictures(
        Path("frames"), lambda n: shown(frames[n], fit), len(frames), size, rate, notes, kept,
        frames if direct else None,
    )  # fmt: skip


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
        return _from_array(path, shape, mosaic, mixed, _ANY_RATE)
    return open_clip(path, shape, mosaic, mixed, _ANY_RATE)


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
    if path.is_file():
        if pages := tiff_pages(path):
            return _from_tiff(path, pages, shape, mosaic, mixed, rate)
        if (still := still_in(path, fit)) is not None:
            return _from_still(path, still, mosaic, fit, notes)
        with path.open("rb") as file:
            head = file.read(21)
        if (head[:4], head[8:16]) == (b"RIFF", b"WEBPVP8X") and head[20] & 2:
            raise fit.bad("an animated WebP, which FFmpeg does not decode: make it a GIF")
    return Clip(path, shape, mosaic, mixed)


def _from_still(
    path: Path, still: Still, mosaic: Mosaic | None, fit: Fit, notes: list[str]
) -> Pictures:
    """The picture of a HEIF file."""
    coded = FrameConverter(path.name, mosaic is not None, fit)
    if still.colours.shape is not None:
        fit.check_size(*still.colours.shape)
    light, pose = decoded_still(path, still, coded, fit)
    size = light.shape[0], light.shape[1]
    return Pictures(path, lambda n: fit.on(light, 1.0, pose, coded.most), 1, size, None, notes)


def _from_tiff(
    path: Path, pages: list[Page], shape: tuple[int, int], mosaic: Mosaic | None, mixed: bool,
    rate: float | None,
) -> Clip | Pictures:  # fmt: skip
    """The pages of a TIFF, which are frames if they have one size."""
    notes: list[str] = []
    fit = Fit(path, shape, mosaic, mixed, notes)
    for page in pages:
        fit.check_size(*page.decoded)
    kept = [n for n, page in enumerate(pages) if page.whole]
    alike = all(pages[n].size == pages[0].size for n in kept)
    if not (kept and alike):
        kept = [0]
    # FFmpeg reads the first page only, and few of floats.
    first = _page(path, 0) if pages[0].floats else None
    if first is None and len(kept) == 1:
        clip = Clip(path, shape, mosaic, mixed)
        if not alike:
            clip.notes.append(f"{path.name}: the first of its {len(pages)} pages is filmed")
        return clip

    def read(n: int) -> Plane:
        found = _page(path, kept[n])
        if found is None:
            raise fit.bad(f"page {kept[n] + 1} cannot be decoded")
        values, opaque = found
        if opaque is not None and (opaque < 1).any():
            fit.note(f"{path.name}: transparent parts are black")
        if values.dtype == np.uint8:  # OpenCV has multiplied these
            opaque = None
        return shown(values, fit, GREY_OF_TIFF if values.ndim == 2 else SRGB, opaque)

    return Pictures(path, read, len(kept), pages[0].size, rate, notes)


def _page(path: Path, page: int) -> tuple[npt.NDArray[Any], npt.NDArray[np.float32] | None] | None:
    """Values of a page of a TIFF, (H, W) or (H, W, 3), and the share of each pixel that is opaque,
    None without alpha. None if OpenCV does not read the page, or not as codes of 8 or 16 bits or
    floats. It does not give the alpha of grey pages."""
    import cv2

    logging = cv2.utils.logging
    before = logging.setLogLevel(logging.LOG_LEVEL_SILENT)  # it writes lines of its own
    try:  # turns them upright, as `imread` does except where rows become columns
        _, read = cv2.imreadmulti(str(path), page, 1, flags=cv2.IMREAD_UNCHANGED)
    except cv2.error:
        return None
    finally:
        logging.setLogLevel(before)
    if not read or not (
        read[0].dtype in (np.uint8, np.uint16) or np.issubdtype(read[0].dtype, np.floating)
    ):
        return None
    values = read[0]
    if values.ndim == 2:
        return values, None
    colours = values[..., 2::-1]  # blue, green, red, and alpha
    if values.shape[2] < 4:
        return colours, None
    most = {1: 255, 2: 65535}[values.itemsize] if values.dtype.kind == "u" else 1
    return colours, np.clip(values[..., 3] / most, 0, 1).astype(np.float32)
