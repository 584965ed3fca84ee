"""Throughput of the chip's row scan, from words of pixels to raw bytes with markers, against the
output of the chip at 40 kHz."""

from __future__ import annotations

from typing import Final

import numpy as np

from cosim.compute.opencl import Device
from cosim.files.raw_layout import FRAME_BYTES, RAW_SIZE
from cosim.run.timing import Row, least_of
from cosim.spikes.viform import WORD
from rtl_model.readout import BIT_RATE, Readout, read_in_numpy

_WORDS: Final = 8
"""Number of words per pixel in a call: 32 MB of spikes, more than the cache."""
_PLAIN_CYCLES: Final = 8
_TURNS: Final = 5


def readout_row(device: Device, ceiling: float | None) -> Row:
    """The row `sensor.readout`. The plain implementation unpacks and packs the bits in numpy.

    Args:
        device: OpenCL device.
        ceiling: measured ceiling, pixel-cycles/s, None if unknown.
    """
    random = np.random.default_rng(1)
    words = random.integers(0, 1 << 32, (_WORDS, *RAW_SIZE[::-1]), dtype=np.uint32)
    cycles = _WORDS * WORD
    readout = Readout(device)
    raw = readout.read(words, cycles)
    spent, plain_spent = least_of(
        [lambda: readout.read(words, cycles, raw), lambda: read_in_numpy(words[:1], _PLAIN_CYCLES)],
        _TURNS,
    )
    value = cycles * FRAME_BYTES * 8 / spent
    share = cycles * RAW_SIZE[0] * RAW_SIZE[1] / spent / ceiling if ceiling else None
    plain = _PLAIN_CYCLES * FRAME_BYTES * 8 / plain_spent
    return Row("sensor.readout", "exact", value, "bit/s", value / BIT_RATE, share, value / plain)
