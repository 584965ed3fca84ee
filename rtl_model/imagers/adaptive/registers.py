"""Registers of the adaptive-exposure sensor: 32-bit words at byte addresses, as the board has.

Document 001 prints the window, its threshold (section 3.1), the 8-bit minimum exposure and the
24-bit multiplier (section 3.3) and an exposure of the user's own; the rest makes the loop visible.
"""

from __future__ import annotations

from rtl_model.imagers.adaptive.decision import LONGEST, MULTIPLIER_BITS
from rtl_model.imagers.adaptive.timing import MINIMUM_CLOCKS, Timing
from rtl_model.registers.table import Field, Register

__all__ = ["DEFAULT_LONGEST", "PARAMETERS", "REGISTERS", "parameters"]

DEFAULT_LONGEST = 16
"""Exponent of the longest exposure that the automatic takes after reset: 2^16 T is 65.536 ms, the
print's range. Up to 24 can be set."""

PARAMETERS: dict[str, str] = {
    "GEOMETRY": "65536 rows + columns",
    "ALL_ROWS": "65536 (rows - 1): all rows",
    "ALL_COLUMNS": "65536 (columns - 1): all columns",
    "ALLOWED": "rows columns / 1024, rounded down",
    "FRAME_CLOCKS": "clocks of a frame whose exposure fits",
    "LINE_CLOCKS": "clocks of a line",
}
"""Every parameter that the table may name, and what it is."""


def parameters(timing: Timing) -> dict[str, int]:
    """Value of every name in `PARAMETERS`."""
    return {
        "GEOMETRY": timing.rows << 16 | timing.columns,
        "ALL_ROWS": (timing.rows - 1) << 16,
        "ALL_COLUMNS": (timing.columns - 1) << 16,
        "ALLOWED": timing.rows * timing.columns >> 10,
        "FRAME_CLOCKS": timing.frame,
        "LINE_CLOCKS": timing.line,
    }


def _range(unit: str) -> tuple[Field, ...]:
    return (
        Field("first", 15, 0, f"first {unit} of the window"),
        Field("last", 31, 16, f"last {unit} of the window, inclusive"),
    )


REGISTERS: tuple[Register, ...] = (
    # name, address, mode, reset, width, text
    Register(
        "exposure_minimum", 0x300, "rw", MINIMUM_CLOCKS, 8,
        "shortest exposure T, clocks of 50 ns; 0 is taken as 1; from the next decision",
    ),
    Register(
        "exposure_automatic", 0x304, "rw", 1, 1, "0: exposure_user holds; from the next decision",
    ),
    Register(
        "exposure_user", 0x308, "rw", 1, MULTIPLIER_BITS,
        "multiple of T while not automatic; 0 is taken as 1, more than 2^24 as 2^24",
    ),
    Register(
        "exposure_search", 0x30C, "rw", 1, 2, "when saturated: 1 t/256, 2 root, 3 t/2 (0 as 1)",
    ),
    Register(
        "exposure_longest", 0x310, "rw", DEFAULT_LONGEST, 5,
        f"n of the automatic's longest exposure 2^n T; more than {LONGEST} as {LONGEST}",
    ),
    Register(
        "exposure_multiplier", 0x314, "ro", 1, MULTIPLIER_BITS,
        "multiple of T that the last decision chose",
    ),
    Register("window_rows", 0x320, "rw", "ALL_ROWS", 32, "counts in it; from the next frame",
             fields=_range("row")),
    Register("window_columns", 0x324, "rw", "ALL_COLUMNS", 32, "counts in it; from the next frame",
             fields=_range("column")),
    Register("window_threshold", 0x328, "rw", "ALLOWED", 32,
             "saturated pixels that are still allowed; from the next frame"),
    Register("window_whole_scan", 0x32C, "rw", 0, 1,
             "1: the largest value is sought in the whole frame, 0: in the window"),
    Register("last_frame", 0x340, "ro", 0, 32, "number of the frame that was decided on last"),
    Register("last_saturated", 0x344, "ro", 0, 32, "its saturated pixels in the window"),
    Register("last_largest", 0x348, "ro", 0, 9, "its largest unsaturated value; 256 for none"),
    Register("last_multiplier", 0x34C, "ro", 1, MULTIPLIER_BITS, "multiple of T of its exposure"),
    Register("last_flag", 0x350, "ro", 0, 1, "1: it had too many saturated pixels"),
    Register("frames", 0x354, "ro", 0, 32, "frames decided on since power-on"),
    Register("timing_geometry", 0x360, "ro", "GEOMETRY", 32, "size of the pixel array",
             fields=(Field("columns", 15, 0, "pixels in a row"), Field("rows", 31, 16, "rows"))),
    Register("timing_frame", 0x364, "ro", "FRAME_CLOCKS", 32, PARAMETERS["FRAME_CLOCKS"]),
    Register("timing_line", 0x368, "ro", "LINE_CLOCKS", 32, PARAMETERS["LINE_CLOCKS"]),
)  # fmt: skip
