"""Sizes of a stream, with a general compressor and with the first-spike codes, and the report's
section on them.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np
import numpy.typing as npt
from numcodecs.zstd import Zstd

from cosim import SpikeStream, Viform
from cosim.compute.stopping import threads
from cosim.config.amounts import count, number
from cosim.run.result import Metric
from cosim.spikes.viform import Words, unpack_planes
from sensor.codec.coding import Code, encode

SAMPLE = 128
"""Rows, and pixels of each, whose size is measured in a run's stream."""
_BITS = 1 << 26
"""Bits of a sample: a longer stream has fewer rows and then columns of it, down to _LEAST."""
_LEAST = (16, 8)
"""Fewest rows of a sample, and pixels of each."""
_GOLDEN = (5**0.5 - 1) / 2
K = 3.0
"""Standard deviations of the statistical code in a report."""
REFINE = 8
"""Widths in its means, which come far nearer to the light than the paper's single widths."""
UNIT = "bit/pixel-cycle"
_THREADS = 2
"""Threads that measure a size each: a code has the events of 512 cycles of the sample in memory."""
_UNPACKED = 1024
"""Planes that are unpacked at a time, a byte a bit."""
LAYOUTS = ("plane", "word", "pixel")
"""Orders of the raw bits: plane after plane as in a .dat, word after word of all pixels as in
stream.zarr, and pixel after pixel."""


@dataclass(frozen=True)
class Sizes:
    """Bits per pixel and cycle; a raw stream has 1.

    Attributes:
        zstd, repeat, line, statistical: bits of each form.
        pixels, all_pixels: number of pixels that were measured, and of the stream.
    """

    zstd: float
    repeat: float
    line: float
    statistical: float
    pixels: int
    all_pixels: int


def measure_sizes(part: Viform, all_pixels: int, threshold: float, noise: float) -> Sizes:
    """Sizes of a stream.

    Args:
        part: the stream, or a sample of its pixels; see `sample_places`.
        all_pixels: pixels of the stream.
        threshold, noise: electrons, what the statistical code takes for chance.
    """
    statistical = Code("statistical", K, max(threshold, 1e-3), min(noise, threshold), REFINE)
    with threads(_THREADS) as pool:
        zstd = pool.submit(zstd_size, part, 3)
        codes = (Code("repeat"), Code("line"), statistical)
        repeat, line, changes = (size for size, _ in pool.map(partial(coded_size, part), codes))
        pixels = part.shape[0] * part.shape[1]
        return Sizes(min(zstd.result().values()), repeat, line, changes, pixels, all_pixels)


def size_metrics(sizes: Sizes) -> dict[str, Metric]:
    """Metrics for result.json; size_first_spike is the smaller of the two lossless sizes."""
    return {
        "size_zstd": Metric(sizes.zstd, UNIT),
        "size_repeat": Metric(sizes.repeat, UNIT),
        "size_first_spike": Metric(min(sizes.repeat, sizes.line), UNIT),
        "size_line": Metric(sizes.line, UNIT),
        "size_statistical": Metric(sizes.statistical, UNIT),
    }


def size_text(sizes: Sizes) -> str:
    """What was measured, in a sentence or two."""
    what = (
        "the whole stream"
        if sizes.pixels == sizes.all_pixels
        else f"a sample, {count(sizes.pixels)} of its {count(sizes.all_pixels)} pixels"
    )
    return (
        f"Measured on {what}. A first-spike code sends a spike only when the width changes (Huang "
        "2022, section 5.2). repeat and line lose nothing (viform convert RUN out.fsc); "
        f"statistical drops changes within {number(K)} standard deviations of a width "
        f"and sends the mean of the {REFINE} widths after each that it does not."
    )


def size_rows(sizes: Sizes) -> list[list[str]]:
    """Rows of the table: form, bits a pixel and cycle, share of raw."""
    named = (
        ("raw, one bit a pixel and cycle", 1.0),
        ("zstd level 3 of that, in the order that is best", sizes.zstd),
        ("first spikes: repeat, the paper's rule", sizes.repeat),
        ("first spikes: line, residual-carrying pixels", sizes.line),
        (f"first spikes: statistical, k = {K:g}, means of {REFINE} (lossy)", sizes.statistical),
    )
    return [[name, number(size), number(1 / size) if size else "any"] for name, size in named]


def sample_places(
    shape: tuple[int, int], cycles: int
) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.intp]]:
    """Rows (n, 1) and columns (n, m) of the sample of a stream: SAMPLE rows, evenly spaced, of each
    SAMPLE neighbouring pixels, spread by the golden ratio; all of a stream that is no larger. A
    long stream has fewer of both."""
    height, width = shape
    wide, pixels = min(SAMPLE, width), _BITS // cycles
    high = min(SAMPLE, height, max(pixels // wide, _LEAST[0]))
    wide = min(wide, max(pixels // high, _LEAST[1]))
    n = np.arange(high)
    rows = (2 * n + 1) * height // (2 * high)
    first = (n * _GOLDEN % 1 * (width - wide + 1)).astype(int)
    return rows[:, None], first[:, None] + np.arange(wide)


def layout(stream: Viform, name: str) -> bytes:
    """The raw bits in one of LAYOUTS."""
    words: Words = stream.words
    if name == "plane":
        parts = []
        for first in range(0, stream.cycles, _UNPACKED):
            last = min(first + _UNPACKED, stream.cycles)
            planes = unpack_planes(words, first, last).reshape(last - first, -1)
            parts.append(np.packbits(planes, axis=1, bitorder="little").tobytes())
        return b"".join(parts)
    return words.tobytes() if name == "word" else words.reshape(len(words), -1).T.tobytes()


def zstd_size(stream: Viform, level: int, names: tuple[str, ...] = LAYOUTS) -> dict[str, float]:
    """Size of each layout after zstd, bits per pixel and cycle."""
    coder = Zstd(level=level)
    return {name: _per_cycle(stream, len(coder.encode(layout(stream, name)))) for name in names}


def coded_size(stream: SpikeStream, code: Code, level: int | None = 3) -> tuple[float, int]:
    """Size in a first-spike code, bits per pixel and cycle, and the number of events."""
    size = events = 0
    for frame in encode(stream, code, level):
        size, events = size + len(frame.data), events + frame.events
    return _per_cycle(stream, size), events


def _per_cycle(stream: SpikeStream, size: int) -> float:
    return 8 * size / (stream.cycles * stream.shape[0] * stream.shape[1])
