"""Streams of random numbers: the second word of a Philox key, whose first word is a seed.

Draws of one stream differ by their counter, and draws of two streams by this number. A number is
used once and never changes, because the bits of a run depend on it.
"""

from __future__ import annotations

from enum import IntEnum, unique


@unique
class Stream(IntEnum):
    """Numbers of the streams; those between the groups are free."""

    NONE = 0
    """Number for an effect without draws."""
    SHOT_NOISE = 1
    """Thresholds of intervals, with shot noise and threshold noise in one draw."""
    INITIAL_CHARGE = 2
    METASTABILITY = 3
    """Settling time of a metastable latch."""
    CHARGE = 4
    """Latched pixels: electrons of readings below threshold."""
    ROW_TIMING = 5
    """Sampling instants of pixels in a band of rows."""
    DRIFT = 6
    """Gain that all pixels have in common."""
    CALL = 7
    """Seeds of the calls of a camera after the first."""
    PATTERN = 16
    """Fixed pattern of pixels; keyed by the seed of the device, not of the run."""
    SKIPPED = 48
    """Asynchronous pixels: stretches of unreported intervals, and their ends."""
    READING = 49
    """Asynchronous pixels: electrons of readings below threshold."""
    CONTINUOUS = 64
    """All draws of continuous photographing."""
    VIBRATION = 80
    """Camera of a link: its displacement from symbol to symbol."""
    SCINTILLATION = 81
    """Air between the ends of a link."""
    SERIAL_NOISE = 96
    """Serial line of a virtual board: inverted bits."""
    IMAGER_SHOT = 112
    """Conventional imagers: photoelectrons."""
    IMAGER_DARK = 113
    """Dark electrons."""
    IMAGER_READ = 114
    """Noise of the analog chain."""
    IMAGER_RESET = 115
    IMAGER_GAIN = 116
    """Electron multiplication of any kind."""
    IMAGER_LOSS = 117
    """Electrons lost in transfer."""
    IMAGER_CLOCKS = 118
    """Clock-induced electrons."""
    IMAGER_IONS = 119
    """Ion events in a tube."""
    IMAGER_SPREAD = 120
    """Spread of the places where electrons land."""
    IMAGER_PATTERN = 121
    """Fixed pattern; keyed by the seed of the device."""
    IMAGER_THERMAL = 122
    """Temperature sensor and surroundings of a cooler."""
    IMAGER_LINES = 123
    """Data lines of a converter: delays (keyed by the seed of the device) and jitter of edges."""
    IMAGER_WHITE = 124
    """White noise of a sensor's output."""
    IMAGER_TRANSFER = 125
    """Noise of the clocks that transfer charge."""
    IMAGER_CIRCUIT = 126
    """Noise of the circuit between sensor and converter."""
