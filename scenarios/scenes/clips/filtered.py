"""What FFmpeg's filters tell and do of decoded frames: which way up they are, and fields."""

from __future__ import annotations

import math
import struct
from collections.abc import Sequence
from typing import Any, Final

import numpy as np
import numpy.typing as npt

Pose = tuple[bool, int]
"""What turns a stored picture upright: whether it is mirrored, left to right, and then the number
of quarter turns, counterclockwise."""
AS_STORED: Final[Pose] = (False, 0)

_MATRIX: Final = 6
"""FFmpeg's number of the side data with a display matrix."""
_KINDS: Final = 40
"""Kinds of side data, with some to come."""


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
