"""Every stream of random numbers: the second word of a Philox key, the first being a seed.

Draws of one stream differ by their counter, those of two streams by this number, so it is given
out once and never changes: a run's bits hang on it.
"""

from __future__ import annotations

from enum import IntEnum, unique

__all__ = ["Stream"]


@unique
class Stream(IntEnum):
    """Numbers between the groups are free."""

    NONE = 0
    """Of an effect that draws nothing."""
    SHOT_NOISE = 1
    """Thresholds of intervals, with shot noise and threshold noise in one draw."""
    INITIAL_CHARGE = 2
    METASTABILITY = 3
    """Time that a latch takes to decide."""
    PATTERN = 16
    """What stays from pixel to pixel; its seed is the device's, so no run's noise shares it."""
    SKIPPED = 48
    """Asynchronous pixels: stretches of unreported intervals, and what ends them."""
    READING = 49
    """Asynchronous pixels: electrons of readings below threshold."""
    CONTINUOUS = 64
    """All that continuous photographing draws."""
    VIBRATION = 80
    """Of a link's camera: how it is pushed from symbol to symbol."""
    SCINTILLATION = 81
    """Of the air between a link's ends."""
    SERIAL_NOISE = 96
    """Of a virtual board's serial line: which bits are inverted."""
    IMAGER_SHOT = 112
    """Conventional imagers: photoelectrons."""
    IMAGER_DARK = 113
    """Electrons that gather without light."""
    IMAGER_READ = 114
    """Noise of the analog chain."""
    IMAGER_RESET = 115
    IMAGER_GAIN = 116
    """Of electron multiplication, whatever its kind."""
    IMAGER_LOSS = 117
    """Electrons that are lost on their way."""
    IMAGER_CLOCKS = 118
    """Electrons that clocks induce."""
    IMAGER_IONS = 119
    """Of ion events in a tube."""
    IMAGER_SPREAD = 120
    """Where electrons land."""
    IMAGER_PATTERN = 121
    """What stays from frame to frame; its seed is the device's."""
    IMAGER_THERMAL = 122
    """Of a cooler's sensor and surroundings."""
