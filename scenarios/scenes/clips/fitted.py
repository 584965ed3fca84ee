"""Pictures of linear light on the pixels of a sensor, and what FFmpeg's filters tell and do of
decoded frames: which way up they are, and fields."""

from __future__ import annotations

import math
import struct
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from cosim import InputError, Plane
from cosim.compute.memory import check_memory
from cosim.light.mosaic import Mosaic

Pose = tuple[bool, int]
"""What turns a stored picture upright: whether it is mirrored, left to right, and then the number
of quarter turns, counterclockwise."""
AS_STORED: Final[Pose] = (False, 0)
_MATRIX: Final = 6
"""FFmpeg's number of the side data with a display matrix."""
_KINDS: Final = 40
"""Kinds of side data, with some to come."""
MOST_PIXELS: Final = 1 << 26
"""Pixels of a picture, at most: twice those of 8K video (7680 x 4320)."""
DECODING: Final = {"max_pixels": str(MOST_PIXELS)}
"""Options of FFmpeg: it refuses larger pictures when it has read their size."""
CONVERTING: Final = {"threads": 1}
"""Options of the conversion of a frame. With more, each frame that is kept would keep threads of
its own; a forked process has none of them, and would wait for ever to free the frame."""
_BYTES: Final = 40
"""Bytes that a picture takes for each pixel while it is read, at most: decoded, with 16 bits of
three colours, and as three float32 twice."""
_WIDEST: Final = 8
"""Times the pixels of the sensor up to which a scaled picture is cropped after it is scaled."""
LUMINANCE = np.array([0.2126, 0.7152, 0.0722], np.float32)
"""Weights of linear R, G, B (Rec. ITU-R BT.709-6, item 3.2)."""
_CROPPED = 0.9
"""Share of the picture below which a note states that it is cropped."""


def _filtered(frames: Sequence[Any], *filters: tuple[str, str]) -> list[Any]:
    """Frames after a chain of filters, each a name and its options."""
    import av
    from av.filter import Graph

    graph, first = Graph(), frames[0]
    last = graph.add_buffer(
        width=first.width, height=first.height, format=first.format, time_base=first.time_base
    )
    for name, options in (*filters, ("buffersink", "")):
        node = graph.add(name, options)
        last.link_to(node)
        last = node
    graph.configure()
    made: list[Any] = []
    for frame in (*frames, None):
        graph.vpush(frame)
        try:
            while True:
                made.append(graph.vpull())
        except (av.BlockingIOError, av.EOFError):
            pass
    return made


def pose_of(frame: Any) -> Pose:
    """How a frame is turned upright, by its display matrix (ISO/IEC 14496-12, 8.2.2) or, which
    FFmpeg makes one of, its Exif orientation.

    PyAV 18 refuses to give any side data of a frame that has some that it does not know, such as
    Exif, and frees the name of an ICC profile twice, which ends the process. So all but the matrix
    is removed before.
    """
    others = [("sidedata", f"mode=delete:type={n}") for n in range(_KINDS) if n != _MATRIX]
    side = _filtered([frame], *others)[0].side_data.get("DISPLAYMATRIX")
    if side is None:
        return AS_STORED
    a, b, _, c, d, *_ = struct.unpack("=9i", bytes(side))
    mirrored = a * d - b * c < 0  # x' = a x + c y, y' = b x + d y; y down
    if mirrored:
        a, b = -a, -b
    return mirrored, -round(math.atan2(b, a) / (math.pi / 2)) % 4


def upright(picture: npt.NDArray[Any], pose: Pose) -> npt.NDArray[Any]:
    """A picture, (H, W, ...), turned upright."""
    mirrored, turns = pose
    return np.rot90(picture[:, ::-1] if mirrored else picture, turns)


def deinterlaced(before: Any | None, frame: Any, after: Any | None) -> Any:
    """The picture of the first field of a frame of two fields, its other lines interpolated from
    the frames around it, by BWDIF (FFmpeg).

    Args:
        before: the frame before it; None for the first.
        frame: the frame.
        after: the frame after it; None for the last.
    """
    form = frame.width, frame.height, frame.format.name
    before, after = (
        None if each is None or (each.width, each.height, each.format.name) != form else each
        for each in (before, after)
    )
    frames = [each for each in (before, frame, after) if each is not None]
    made = _filtered(frames, ("bwdif", "mode=send_frame:deint=interlaced"))
    return made[0 if before is None else 1]


class Fit:
    """Fits the pictures of a file to a (height, width) grid of pixels.

    Args:
        path: the file, for messages.
        shape: (height, width).
        mosaic: filter array on the pixels; None for one colour.
        mixed: whether each pixel takes the colour of its filter.
        notes: takes notes for the user.

    Attributes:
        shape: (height, width).
        told: the notes since somebody has cleared it, also those that the user has.
    """

    def __init__(
        self, path: Path, shape: tuple[int, int], mosaic: Mosaic | None, mixed: bool,
        notes: list[str],
    ) -> None:  # fmt: skip
        self._path, self.shape, self._notes = path, shape, notes
        self._mosaic, self._mixed = mosaic, mixed
        self.told: dict[str, None] = {}

    def note(self, text: str) -> None:
        """A note for the user, once."""
        self.told[text] = None
        if text not in self._notes:
            self._notes.append(text)

    def bad(self, actual: str) -> InputError:
        """The refusal of the file."""
        return InputError(
            "scene.path", "a clip or image that can be decoded", f"{self._path} ({actual})",
            "check the file, or leave scene.path out for the built-in scene",
        )  # fmt: skip

    def undecodable(self, exc: Exception) -> InputError:
        """The refusal of a file in which decoding failed. FFmpeg reports sizes beyond its limits,
        which a damaged file states, as a lack of memory."""
        if isinstance(exc, MemoryError):
            return self.bad("damaged: it states more data than a clip can have")
        return self.bad(str(getattr(exc, "strerror", None) or exc))

    def on(
        self, light: npt.NDArray[np.float32], aspect: float = 1.0, pose: Pose = AS_STORED,
        most: float | None = None,
    ) -> Plane:  # fmt: skip
        """Light turned upright, scaled to cover the grid, and cropped at the centre: (H, W), or
        (H, W, 3) behind a mosaic that is not mixed.

        Args:
            light: (h, w), or (h, w, 3) behind a mosaic; white = 1.
            aspect: width of a stored pixel over its height.
            pose: how the picture is turned upright.
            most: upper limit of the light, None for none.
        """
        import cv2

        height, width = light.shape[:2]
        wide = max(1, round(width * aspect)) if 0.1 < aspect < 10 else width
        light = upright(light, pose)
        if pose[1] % 2:
            height, wide = wide, height
        rows, columns = self.shape
        scale = max(rows / height, columns / wide)
        size = (max(columns, round(wide * scale)), max(rows, round(height * scale)))
        shrinks = size[0] < light.shape[1] and size[1] < light.shape[0]
        share = rows * columns / (size[0] * size[1])
        if share < _CROPPED:
            self.note(
                f"{self._path.name}: {share:.0%} of the picture is filmed, cropped at the centre "
                f"to the sensor's {columns} x {rows}"
            )
        top, left = (size[1] - rows) // 2, (size[0] - columns) // 2
        if light.shape[:2] == (rows, columns) and size == (columns, rows):
            plane: npt.NDArray[Any] = light
        elif shrinks or share * _WIDEST >= 1:
            method = cv2.INTER_AREA if shrinks else cv2.INTER_LINEAR
            scaled = cv2.resize(np.ascontiguousarray(light), size, interpolation=method)
            plane = scaled[top : top + rows, left : left + columns]
        else:  # a picture of a row becomes a thousand times as wide as the sensor
            plane = _part(light, size, (top, left), self.shape)
        if most is not None:
            plane = np.clip(plane, 0, most)
        if self._mosaic is not None and self._mixed:
            plane = self._mosaic.mixed(plane)
        return np.ascontiguousarray(plane, dtype=np.float32)

    def floats(
        self, values: npt.NDArray[Any], aspect: float = 1.0, pose: Pose = AS_STORED
    ) -> Plane:
        """`on` for floats that are linear light, white = 1, without upper limit.

        Args:
            values: (h, w), or (h, w, 3) in linear red, green and blue (BT.709).
            aspect, pose: see `on`.

        Raises:
            InputError: a value is no finite number.
        """
        light = values.astype(np.float32)
        if not np.isfinite(light).all():
            raise self.bad("a value that is no finite number")
        if light.min(initial=0) < 0:
            self.note(f"{self._path.name}: values below 0 are black")
            light = np.maximum(light, 0)
        light = self._coloured(light)
        if light.max(initial=0) > 1:
            self.note(f"{self._path.name}: light above white (1) is filmed as it is")
        return self.on(light, aspect, pose)

    def codes(
        self, values: npt.NDArray[Any], curve: npt.NDArray[np.float32],
        opaque: npt.NDArray[np.float32] | None = None,
    ) -> Plane:  # fmt: skip
        """`on` for codes of a transfer characteristic.

        Args:
            values: (h, w), or (h, w, 3), uint8 or uint16.
            curve: light of each code, from 0 to 1.
            opaque: share of each pixel that is, (h, w); the rest is black. None for all.
        """
        import cv2

        # OpenCV's table is eight times as fast as an index.
        light = cv2.LUT(values, curve) if values.dtype == np.uint8 else curve[values]
        if opaque is not None:
            light = light * (opaque if light.ndim == 2 else opaque[..., None])
        return self.on(self._coloured(np.asarray(light, np.float32)))

    def _coloured(self, light: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
        """Luminance of colours; behind a mosaic (h, w, 3)."""
        if self._mosaic is None:
            return light @ LUMINANCE if light.ndim == 3 else light
        return np.repeat(light[..., None], 3, axis=2) if light.ndim == 2 else light

    _passed = (0, 0)
    """The size of the picture before, for which free memory was asked."""

    def check_size(self, height: int, width: int) -> None:
        """Raises InputError for a picture of too many pixels, or if memory is short."""
        if (height, width) == self._passed:  # reading the limits takes as long as decoding
            return
        if height * width > MOST_PIXELS:
            raise self.bad(f"{width} x {height} pixels: {MOST_PIXELS:,} at most are accepted")
        what = f"scene.path, {self._path} of {width} x {height} pixels,"
        check_memory(what, _BYTES * height * width, "scale it down")
        self._passed = height, width


def _part(
    light: npt.NDArray[np.float32], size: tuple[int, int], begin: tuple[int, int],
    shape: tuple[int, int],
) -> npt.NDArray[np.float32]:  # fmt: skip
    """A part of a picture that is scaled by bilinear interpolation, as OpenCV does, without the
    rest of it.

    Args:
        light: (h, w, ...).
        size: (width, height) of the whole picture after scaling.
        begin: first row and column of the part in it.
        shape: rows and columns of the part.
    """
    shares = [light.shape[axis] / shape[axis] for axis in (0, 1)]
    for axis in (1, 0) if shares[1] > shares[0] else (0, 1):  # first the one that is cut most
        scaled, first, count = size[1 - axis], begin[axis], shape[axis]
        length = light.shape[axis]
        place = np.clip((np.arange(first, first + count) + 0.5) * length / scaled - 0.5, 0, None)
        low = np.minimum(place.astype(np.int64), length - 1)
        weight = (place - low).astype(np.float32).reshape(-1, *(1,) * (light.ndim - 1 - axis))
        one, two = (np.take(light, np.minimum(low + n, length - 1), axis) for n in (0, 1))
        light = one + (two - one) * weight
    return light
