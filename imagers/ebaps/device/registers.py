"""Registers of the EBAPS board: KEY, high voltage, exposure and its loop, dark subtraction.

The names KEY, step, window and the exposures' limits are document 002's; addresses and the rest are
ours. Exposures are in ns, as the document gives them; the high voltage is its magnitude in volts.
"""

from __future__ import annotations

from imagers.ebaps.board.timing import CLOCK_HZ, Timing
from imagers.ebaps.device.exposure import (
    DEFAULT_EXPOSURE,
    SHORTEST_EXPOSURE,
    STEP,
    WINDOW,
)
from rtl_model.registers import Field, Register
from rtl_model.registers.design import Design

HIGH_VOLTAGE = 1500
"""Largest high voltage of the tests, V: document 002, section 4."""

REGISTERS: tuple[Register, ...] = (
    Register("ebaps_key", 0x300, "rw", 0, 1, "KEY: 1 stores dark frames, 0 stores live ones"),
    Register("ebaps_high_voltage", 0x304, "rw", HIGH_VOLTAGE, 11, "V below ground, 1500 at most"),
    Register("ebaps_exposure", 0x308, "rw", DEFAULT_EXPOSURE, 26, "ns; the loop writes it too"),
    Register(
        "ebaps_loop", 0x30C, "rw", 1, 3, "exposure loop",
        fields=(
            Field("on", 0, 0, "1 lets the loop set the exposure, except while darks are taken"),
            Field("every", 1, 1, "1 acts on every frame, 0 on those that show its last action"),
            Field("raw", 2, 2, "1 takes the mean before dark subtraction, 0 after it"),
        ),
    ),
    Register("ebaps_window_low", 0x310, "rw", WINDOW[0], 16, "DN, least mean that stays"),
    Register("ebaps_window_high", 0x314, "rw", WINDOW[1], 16, "DN, largest mean that stays"),
    Register("ebaps_step", 0x318, "rw", STEP, 26, "ns"),
    Register("ebaps_shortest", 0x31C, "rw", SHORTEST_EXPOSURE, 26, "T_min, ns"),
    Register("ebaps_longest", 0x320, "rw", Timing().longest_exposure, 26, "T_max, ns"),
    Register("ebaps_subtract", 0x324, "rw", 1, 1, "1 takes the mean of four darks away"),
    Register("ebaps_pedestal", 0x328, "rw", 0, 16, "DN added to the difference"),
    Register(
        "ebaps_shutter", 0x32C, "rw", 2, 2, "0 open, 1 closed, 2 closed while KEY is 1 (3 as 2)"
    ),
    Register(
        "ebaps_refresh", 0x330, "rw", 0, 1,
        "1 stores four darks by itself when the loop rests at an exposure they were not taken at",
    ),
    Register("ebaps_frames", 0x340, "ro", 0, 32, "frames read since power-on"),
    Register("ebaps_mean", 0x344, "ro", 0, 16, "DN, of the last live frame, rounded down"),
    Register("ebaps_dark_exposure", 0x348, "ro", 0, 26, "ns, of the darks; 0 if not four alike"),
    Register(
        "ebaps_status", 0x34C, "ro", 0, 6, "what the last frame said",
        fields=(
            Field("settled", 0, 0, "its mean lies in the window and its exposure stands"),
            Field("dark", 1, 1, "too dark even at the longest exposure"),
            Field("bright", 2, 2, "too bright even at the shortest exposure"),
            Field("darks", 3, 3, "four dark frames are stored"),
            Field("stale", 4, 4, "they are of another exposure or voltage than stands now"),
            Field("key", 5, 5, "it was a dark frame"),
        ),
    ),
)  # fmt: skip

DESIGN = Design(
    "ebaps",
    2,
    "EBAPS imaging circuit",
    (Timing().rows, Timing().columns),
    CLOCK_HZ,
    REGISTERS,
    {
        entry.name: "frame"
        for entry in REGISTERS
        if entry.mode == "rw" and entry.name in ("ebaps_key", "ebaps_high_voltage", "ebaps_shutter")
    },
)
"""What is taken with a frame is taken when its VSYNC falls; limits and the loop act at once."""
