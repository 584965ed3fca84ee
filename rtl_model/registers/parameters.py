"""The parameters of a build that the register map uses, derived from a Geometry."""

from __future__ import annotations

from rtl_model.geometry import Geometry
from rtl_model.registers.table import WRITE_WORDS, Register

PARAMETERS: dict[str, str] = {
    "GEOMETRY": "65536 rows + columns",
    "LANES": "32 or 64",
    "CLOCK_HZ": "the board's clock, Hz",
    "BUILD": "CRC-32 of the Verilog and its parameters",
    "BIT_CLOCKS": "CLOCK_HZ / baud, rounded",
    "ALL_ROWS": "65536 (rows - 1): all rows",
    "ALL_COLUMNS": "65536 (columns - 1): all columns",
    "TICK_CLOCKS": "the greater of CLOCK_HZ / 40 000 and TICK_MINIMUM",
    "TICK_MINIMUM": "rows (row_words + 4) + 4, with row_words 32-bit words in a row of whole tiles",
    "CAPTURE_WORDS": "words of the capture memory, a power of two",
    "SINK_WORDS": "words of the sink's memory, a power of two",
    "IDENTIFIER_BYTES": "four for each character of the identifier and the NUL",
    "PATTERN_BYTES": "a byte for each pixel of each row of whole tiles",
    "WRITE_BYTES": "256 words: three of the head, and the data",
    "CAPTURE_BYTES": "4 CAPTURE_WORDS",
}
"""Every parameter that the register map may name, with its meaning."""


def identifier(geometry: Geometry) -> str:
    """The identifier of a board, without the final NUL."""
    return f"Viform spike board {geometry.rows}x{geometry.columns}"


def parameters(geometry: Geometry, build: int = 0) -> dict[str, int]:
    """The value of every parameter in `PARAMETERS`; `build` is the CRC-32 of the build."""
    return {
        "GEOMETRY": geometry.rows << 16 | geometry.columns,
        "LANES": geometry.lanes,
        "CLOCK_HZ": geometry.clock_hz,
        "BUILD": build,
        "BIT_CLOCKS": geometry.bit_clocks,
        "ALL_ROWS": (geometry.rows - 1) << 16,
        "ALL_COLUMNS": (geometry.columns - 1) << 16,
        "TICK_CLOCKS": geometry.tick_clocks,
        "TICK_MINIMUM": geometry.tick_minimum,
        "CAPTURE_WORDS": geometry.capture_words,
        "SINK_WORDS": geometry.sink_words,
        "IDENTIFIER_BYTES": 4 * (len(identifier(geometry)) + 1),
        "PATTERN_BYTES": geometry.pattern_bytes,
        "WRITE_BYTES": 4 * WRITE_WORDS,
        "CAPTURE_BYTES": 4 * geometry.capture_words,
    }


def reset_value(register: Register, values: dict[str, int]) -> int:
    """The value of `register` after reset, given the `parameters` of the build."""
    return register.reset if isinstance(register.reset, int) else values[register.reset]
