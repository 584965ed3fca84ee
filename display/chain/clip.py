"""The slow motion of all displays side by side, as an MP4 clip."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from cosim import PS
from cosim.files.atomic import atomic_write
from display.observe.slow_motion import SlowMotion

RATE = 25
"""Frame rate of the clip, 1/s."""
TILES = 8
COLUMNS = 4
GAP = 6
"""Gap between pictures, pixels."""
TEXT = 26
"""Height of the strip with the name of a picture, pixels."""
GROUND, INK = 24, 235
Grey = npt.NDArray[np.uint8]


def chosen_tiles(names: list[str], most: int = TILES) -> list[str]:
    """At most `most` of the displays, in their order. Of the frame displays, the middle ones are
    removed first."""
    names = list(names)
    while len(names) > most:
        frames = [name for name in names if name.endswith(" Hz")]
        if len(frames) < 2:
            return names[:most]
        names.remove(frames[len(frames) // 2])
    return names


def _label(width: int, text: str) -> Grey:
    strip = np.full((TEXT, width), GROUND, np.uint8)
    size = 0.5
    while size > 0.3 and cv2.getTextSize(text, cv2.FONT_HERSHEY_SIMPLEX, size, 1)[0][0] > width - 6:
        size -= 0.05
    place = (4, TEXT - 9)
    cv2.putText(strip, text, place, cv2.FONT_HERSHEY_SIMPLEX, size, INK, 1, cv2.LINE_AA)
    return strip


def _sized(picture: Grey, height: int, width: int) -> Grey:
    """A tile of this size with the whole picture, undistorted."""
    if picture.shape == (height, width):
        return picture
    scale = min(height / picture.shape[0], width / picture.shape[1])
    high, wide = (max(1, round(n * scale)) for n in picture.shape)
    tile = np.full((height, width), GROUND, np.uint8)
    method = cv2.INTER_NEAREST if scale >= 1 else cv2.INTER_AREA
    y, x = (height - high) // 2, (width - wide) // 2
    tile[y : y + high, x : x + wide] = cv2.resize(picture, (wide, high), interpolation=method)
    return tile


def _sheet(pictures: list[Grey], labels: list[Grey]) -> Grey:
    """A sheet of pictures with labels; both sides are even, as H.264 in yuv420p requires."""
    high, wide = pictures[0].shape[0] + TEXT, pictures[0].shape[1]
    columns = min(COLUMNS, len(pictures))
    rows = -(-len(pictures) // columns)
    height, width = rows * (high + GAP) + GAP, columns * (wide + GAP) + GAP
    sheet = np.full((height + height % 2, width + width % 2), GROUND, np.uint8)
    for n, (picture, label) in enumerate(zip(pictures, labels, strict=True)):
        y, x = GAP + n // columns * (high + GAP), GAP + n % columns * (wide + GAP)
        sheet[y : y + TEXT, x : x + wide] = label
        sheet[y + TEXT : y + high, x : x + wide] = picture
    return sheet


def write_display_clip(
    path: Path, frames: Mapping[str, Grey], titles: Mapping[str, str], motion: SlowMotion
) -> None:
    """Writes an MP4 clip (H.264, yuv420p) for browsers.

    Args:
        path: file to write.
        frames: frames by display, (frames, h, w) uint8 with the sRGB curve applied.
        titles: title of each display.
        motion: times and size of the frames.
    """
    import av

    height, width = motion.shape
    times = max(1, 200 // max(height, width))  # small pictures are enlarged without interpolation
    height, width = height * times, width * times
    labels = {name: _label(width, title) for name, title in titles.items()}
    with atomic_write(path) as part, av.open(str(part), "w", format="mp4") as container:
        video: Any = container.add_stream("libx264", rate=RATE)
        video.pix_fmt = "yuv420p"
        video.options = {"crf": "28", "preset": "superfast", "movflags": "+faststart"}
        for n in range(motion.count):
            ms = (motion.begin + n * motion.exposure + motion.exposure // 2) * 1e3 / PS
            pictures = [_sized(frames[name][n], height, width) for name in frames]
            stamps = [
                labels[name] if k else _label(width, f"{titles[name]}, {ms:.1f} ms")
                for k, name in enumerate(frames)
            ]
            sheet = _sheet(pictures, stamps)
            if n == 0:
                video.height, video.width = sheet.shape
            container.mux(video.encode(av.VideoFrame.from_ndarray(sheet, format="gray")))
        container.mux(video.encode(None))
