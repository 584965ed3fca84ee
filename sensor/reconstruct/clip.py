"""A spike stream as a clip to look at: TFP images in slow motion."""

from __future__ import annotations

import math
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from cosim import InputError, SpikeStream
from cosim.files.atomic import atomic_write
from cosim.report.png import for_display
from cosim.run.progress import Progress
from sensor.reconstruct.playback import tfp

CLIPS = (".mp4", ".mkv", ".mov", ".avi", ".webm", ".gif")
"""Endings of clips."""
_CODECS = {".webm": "libvpx-vp9", ".gif": "gif"}


def write_clip(
    stream: SpikeStream,
    path: Path,
    *,
    window: int,
    every: int,
    scale: float,
    rate: float,
    progress: Progress | None = None,
    largest: int | None = None,
    smallest: int = 1,
    crf: int = 20,
) -> None:
    """A TFP image every `every` cycles, shown at `rate` images a second through the sRGB curve.

    Args:
        scale: the spike rate that becomes white.
        largest: pixels of the longer side; images are reduced by a whole number to stay within it.
            H.264, VP9 in .webm; odd sizes lose their last line.
        smallest: pixels of the shorter side; smaller images are enlarged by a whole number.
        crf: rate factor (CRF) of H.264: 6 more halve the size.
    """
    import av
    import cv2

    for name, value, least, most in (
        ("--every", every, 1, math.inf),
        ("--rate", rate, 0.1, 1000),
        ("--scale", scale, 1e-30, 1e30),
    ):
        if not least <= value <= most:
            must = f"{least:g} to {most:g}" if math.isfinite(most) else f"at least {least:g}"
            raise InputError(name, must, f"{value:g}", "leave it out for the default")
    instants = range(0, stream.cycles, every)
    reduce = -(-max(stream.shape) // largest) if largest else 1
    tall, wide = (min(reduce, n) for n in stream.shape)  # a narrow strip keeps its pixels
    times = max(1, -(-smallest // min(stream.shape[0] // tall, stream.shape[1] // wide)))
    height, width = (
        n // by * times // 2 * 2 for n, by in zip(stream.shape, (tall, wide), strict=True)
    )
    if not height or not width:
        size = f"{stream.shape[1]}x{stream.shape[0]}"
        raise InputError("the stream", "at least 2x2 pixels for a clip", size, "use viform image")
    codec = _CODECS.get(path.suffix.lower(), "libx264")
    white = np.float32(scale)
    if progress is not None:
        progress.start(path.name, len(instants))
    try:
        with (
            atomic_write(path) as part,
            av.open(str(part), "w", format=_container(path)) as container,
        ):
            speed = Fraction(repr(float(rate))).limit_denominator(1001)
            video: Any = container.add_stream(codec, rate=speed)
            video.width, video.height = width, height
            video.pix_fmt = "rgb8" if codec == "gif" else "yuv420p"
            if codec == "libx264":
                video.options = {"crf": str(crf), "preset": "veryfast"}
            for n, cycle in enumerate(instants):
                rates = tfp(stream, cycle, window)
                if reduce > 1:
                    high, long = rates.shape[0] // tall, rates.shape[1] // wide
                    rates = rates[: high * tall, : long * wide]
                    means = cv2.resize(rates, (long, high), interpolation=cv2.INTER_AREA)
                    rates = np.asarray(means, np.float32)
                if times > 1:
                    rates = rates.repeat(times, axis=0).repeat(times, axis=1)
                rates = rates[:height, :width]
                frame = av.VideoFrame.from_ndarray(for_display(rates / white), format="gray")
                container.mux(video.encode(frame))
                if progress is not None:
                    progress.advance(n + 1)
            container.mux(video.encode(None))
    except av.FFmpegError as exc:
        size = f"{width}x{height} ({exc.strerror})"
        raise InputError("the clip", f"of a size that {codec} takes", size, "use .npz") from exc


def _container(path: Path) -> str:
    """FFmpeg's name of the container."""
    return {".mkv": "matroska"}.get(path.suffix.lower(), path.suffix.lower()[1:])
