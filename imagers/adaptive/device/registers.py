"""Registers of the adaptive-exposure sensor, at 0x300 and above.

Document 001 states the window and its threshold (section 3.1), the 8-bit minimum exposure, the
24-bit multiplier (section 3.3) and an exposure set by the user. The other registers show the state
of the loop.
"""

from __future__ import annotations

from imagers.adaptive.device.decision import LONGEST, MULTIPLIER_BITS
from imagers.adaptive.device.timing import CLOCK_HZ, MINIMUM_CLOCKS, Timing
from rtl_model.registers.design import Design, Update
from rtl_model.registers.table import Field, Register

DEFAULT_LONGEST = 16
"""Exponent of the longest automatic exposure after reset: 2^16 T is 65.536 ms, the range of the
document. Values up to 24 can be set."""
DEFAULT_SHAPE = (256, 256)
"""Rows and columns; assumed, because the document does not state them."""
_WITH_FRAME: tuple[str, ...] = (
    "adaptive_rows", "adaptive_columns", "adaptive_threshold", "adaptive_whole_scan",
)  # fmt: skip


def _range(unit: str) -> tuple[Field, ...]:
    return (
        Field("first", 15, 0, f"first {unit} of the window"),
        Field("last", 31, 16, f"last {unit} of the window, inclusive"),
    )


def registers_of(timing: Timing) -> tuple[Register, ...]:
    """The register table of an array. At reset, the window is the whole array, and one pixel in
    1024 (rounded down) may be saturated (assumed)."""
    rows, columns = (timing.rows - 1) << 16, (timing.columns - 1) << 16
    allowed = timing.rows * timing.columns >> 10
    return (
        # name, address, mode, reset, width, text
        Register("adaptive_minimum", 0x300, "rw", MINIMUM_CLOCKS, 8,
                 "shortest exposure T, clocks; 0 as 1; a decision reads it"),
        Register("adaptive_automatic", 0x304, "rw", 1, 1,
                 "0: adaptive_user holds; a decision reads it"),
        Register("adaptive_user", 0x308, "rw", 1, MULTIPLIER_BITS,
                 "multiple of T while not automatic; 0 as 1, more than 2^24 as 2^24"),
        Register("adaptive_search", 0x30C, "rw", 1, 2,
                 "when saturated: 1 t/256, 2 square root, 3 t/2; 0 as 1"),
        Register("adaptive_longest", 0x310, "rw", DEFAULT_LONGEST, 5,
                 f"n of the automatic's longest exposure 2^n T; more than {LONGEST} as {LONGEST}"),
        Register("adaptive_multiplier", 0x314, "ro", 1, MULTIPLIER_BITS,
                 "multiple of T that the last decision chose"),
        Register("adaptive_rows", 0x320, "rw", rows, 32, "window", fields=_range("row")),
        Register("adaptive_columns", 0x324, "rw", columns, 32, "window", fields=_range("column")),
        Register("adaptive_threshold", 0x328, "rw", allowed, 32,
                 "saturated pixels of the window that are allowed"),
        Register("adaptive_whole_scan", 0x32C, "rw", 0, 1,
                 "1: the largest value is sought in the whole frame, 0: in the window"),
        Register("adaptive_last_frame", 0x340, "ro", 0, 32, "frame that was decided on last"),
        Register("adaptive_last_saturated", 0x344, "ro", 0, 32, "its saturated pixels"),
        Register("adaptive_last_largest", 0x348, "ro", 0, 9,
                 "its largest unsaturated value; 256 for none"),
        Register("adaptive_last_multiplier", 0x34C, "ro", 1, MULTIPLIER_BITS,
                 "multiple of T that it was exposed with"),
        Register("adaptive_last_flag", 0x350, "ro", 0, 1, "1: it had too many saturated pixels"),
        Register("adaptive_frames", 0x354, "ro", 0, 32, "frames decided on since reset"),
        Register("adaptive_frame_clocks", 0x360, "ro", timing.frame, 32,
                 "clocks of a frame whose exposure fits"),
        Register("adaptive_line_clocks", 0x364, "ro", timing.line, 32, "clocks of a line"),
    )  # fmt: skip


def design_of(timing: Timing) -> Design:
    """The design behind the serial line for an array."""
    updates: dict[str, Update] = dict.fromkeys(_WITH_FRAME, "frame")
    return Design(
        "adaptive-exposure", 1, "adaptive-exposure CMOS sensor", (timing.rows, timing.columns),
        CLOCK_HZ, registers_of(timing), updates,
    )  # fmt: skip


DESIGN = design_of(Timing.of(*DEFAULT_SHAPE))

REGISTERS = DESIGN.specific
