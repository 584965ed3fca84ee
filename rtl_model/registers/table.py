"""The register map of the board, as one table.

The cycle model, the Verilog header, `csr.csv` and docs/registers.md are derived from it. A register
is one word of 32 bits at a byte address. On the line (LiteX uartbone) an address is counted in
words. Some values are parameters of a build, derived from its geometry.
"""

from __future__ import annotations

from typing import Literal, NamedTuple

from rtl_model.geometry import Geometry

MAGIC = 0x53504B32
"""First word of a Viform board, ASCII "SPK2"."""
VERSION = 0x0001_0002
"""Version of the register map: major number in the upper half, minor in the lower.

Minor number 1 added the memories `write_mem` and `capture_mem`, 2 the register `sensor_reading`."""
WRITE_WORDS = 256
"""Words of `write_mem`, one more than a record of Etherbone can write."""
Mode = Literal["ro", "rw", "wo"]
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


class Field(NamedTuple):
    """A field of a register.

    Attributes:
        name: name of the field.
        high, low: its first and last bit, both inclusive.
        text: meaning.
    """

    name: str
    high: int
    low: int
    text: str


class Register(NamedTuple):
    """One register.

    Attributes:
        name: its group and its name, with an underscore between.
        address: bytes.
        mode: "ro", "rw" or "wo".
        reset: value after reset, or the name of the parameter that gives it (docs/registers.md).
        width: number of implemented bits; the others read 0.
        text: meaning.
        read_effect: whether a read changes it (a FIFO, a generator), so that it must not be
        repeated. fields: of the register.
    """

    name: str
    address: int
    mode: Mode
    reset: int | str
    width: int
    text: str
    read_effect: bool = False
    fields: tuple[Field, ...] = ()


class Memory(NamedTuple):
    """A memory of 32-bit words.

    Attributes:
        name: name of the memory.
        address: address of the first word, bytes.
        size: name of the parameter that gives the size in bytes.
        mode: "ro", "rw" or "wo".
        text: meaning.
    """

    name: str
    address: int
    size: str
    mode: Mode
    text: str


def _range(what: str, unit: str) -> tuple[Field, ...]:
    return (
        Field("first", 15, 0, f"first {unit} of the {what}"),
        Field("last", 31, 16, f"last {unit} of the {what}, inclusive"),
    )


REGISTERS: tuple[Register, ...] = (
    # name, address, mode, reset, width, text
    Register("ctrl_magic", 0x000, "ro", MAGIC, 32, 'ASCII "SPK2"'),
    Register("ctrl_scratch", 0x004, "rw", 0x12345678, 32, "for tests of the bus; without effect"),
    Register("ctrl_version", 0x008, "ro", VERSION, 32, "of the register map: major, minor"),
    Register(
        "ctrl_geometry",
        0x00C,
        "ro",
        "GEOMETRY",
        32,
        "size of the pixel array",
        fields=(Field("columns", 15, 0, "pixels in a row"), Field("rows", 31, 16, "rows")),
    ),
    Register("ctrl_lanes", 0x010, "ro", "LANES", 32, "pixels computed in one clock"),
    Register("ctrl_clock_hz", 0x014, "ro", "CLOCK_HZ", 32, "nominal clock of the board, Hz"),
    Register("ctrl_build", 0x018, "ro", "BUILD", 32, "CRC-32 of the sources and parameters"),
    Register("ctrl_reset", 0x01C, "wo", 0, 1, "1 resets all but the line's counters"),
    Register("ctrl_bus_errors", 0x020, "ro", 0, 32, "accesses to no register or memory"),
    Register("ctrl_uptime", 0x024, "ro", 0, 32, "clocks since power-on, modulo 2^32"),
    Register("uart_rx_bytes", 0x100, "ro", 0, 32, "bytes received"),
    Register("uart_tx_bytes", 0x104, "ro", 0, 32, "bytes sent"),
    Register("uart_framing_errors", 0x108, "ro", 0, 32, "bytes whose stop bit was low; dropped"),
    Register("uart_watchdog_aborts", 0x10C, "ro", 0, 32, "transactions cut after 100 ms"),
    Register("uart_unknown_commands", 0x110, "ro", 0, 32, "transactions with an unknown command"),
    Register("uart_writes", 0x114, "ro", 0, 32, "words written over the line"),
    Register(
        "uart_writes_crc", 0x118, "ro", 0, 32, "CRC-32 of those words, most significant byte first"
    ),
    Register("uart_bit_clocks", 0x11C, "ro", "BIT_CLOCKS", 32, "clocks of a bit on the line"),
    Register("uart_shortest_low", 0x120, "ro", 0xFFFFFFFF, 32, "shortest low pulse, clocks"),
    Register("uart_clear", 0x124, "wo", 0, 1, "1 clears the line's counters; not counted itself"),
    Register("prbs_order", 0x200, "rw", 31, 5, "7, 15, 23 or 31; a write restarts both registers"),
    Register("prbs_source", 0x204, "ro", 0, 32, "next 32 bits, first in bit 31", read_effect=True),
    Register("prbs_check", 0x208, "wo", 0, 32, "32 bits to compare with the same sequence"),
    Register("prbs_checked", 0x20C, "ro", 0, 32, "words checked since the restart"),
    Register("prbs_errors", 0x210, "ro", 0, 32, "wrong bits in these words"),
    Register("sensor_run", 0x300, "rw", 0, 1, "1 scans frames; a started frame is completed"),
    Register("sensor_threshold", 0x304, "rw", 7, 4, "level k: a threshold of 255 + 256 k"),
    Register("sensor_clock_select", 0x308, "rw", 0, 1, "0: 40 kHz, 1: 20 kHz; from the next frame"),
    Register("sensor_reset_rule", 0x30C, "rw", 0, 2, "0 residual, 1 hard, 2 subtract (3 as 0)"),
    Register(
        "sensor_rows",
        0x310,
        "rw",
        "ALL_ROWS",
        32,
        "window; from the next frame",
        fields=_range("window", "row"),
    ),
    Register(
        "sensor_columns",
        0x314,
        "rw",
        "ALL_COLUMNS",
        32,
        "window; from the next frame",
        fields=_range("window", "column"),
    ),
    Register(
        "sensor_tick_clocks",
        0x318,
        "rw",
        "TICK_CLOCKS",
        32,
        "clocks of a 40 kHz tick; from the next frame",
    ),
    Register(
        "sensor_tick_minimum", 0x31C, "ro", "TICK_MINIMUM", 32, "lower limit of the tick, clocks"
    ),
    Register("sensor_pattern", 0x320, "rw", 0, 2, "0 memory, 1 constant, 2 ramp, 3 checker"),
    Register("sensor_level", 0x324, "rw", 0, 8, "level of all patterns but memory"),
    Register(
        "sensor_clear", 0x328, "wo", 0, 1, "1: the next frame is number 0 and starts without charge"
    ),
    Register("sensor_frames", 0x32C, "ro", 0, 32, "frames begun since the clear"),
    Register(
        "sensor_frame_clock", 0x330, "ro", 0, 32, "ctrl_uptime when the last frame or pass began"
    ),
    Register("sensor_rows_read", 0x334, "ro", 0, 32, "rows of the window read since the clear"),
    Register("sensor_spikes", 0x338, "ro", 0, 32, "spikes read since the clear, modulo 2^32"),
    Register(
        "sensor_reading",
        0x33C,
        "wo",
        0,
        3,
        "n > 0: reads the charges in 2^n levels, by 2^n - 1 passes before the next frame; 0 "
        "cancels",
    ),
    Register(
        "capture_source", 0x400, "rw", 0, 1, "0 pixels, 1 the display sink; from the next burst"
    ),
    Register(
        "capture_arm", 0x404, "wo", 0, 32, "frames of a burst that starts with the next frame"
    ),
    Register(
        "capture_state",
        0x408,
        "ro",
        0,
        4,
        "state of the burst",
        fields=(
            Field("armed", 0, 0, "waits for a frame to begin"),
            Field("busy", 1, 1, "rows are being stored"),
            Field("done", 2, 2, "the burst is over"),
            Field("overflow", 3, 3, "rows were lost because the memory was full"),
        ),
    ),
    Register("capture_level", 0x40C, "ro", 0, 32, "words between pointer and end"),
    Register(
        "capture_data", 0x410, "ro", 0, 32, "the next word; 0 beyond the end", read_effect=True
    ),
    Register(
        "capture_pointer", 0x414, "rw", 0, 32, "index of the next word to read; may be set back"
    ),
    Register("capture_rows", 0x418, "ro", 0, 32, "rows stored in this burst"),
    Register("capture_lost", 0x41C, "ro", 0, 32, "rows of this burst that did not fit"),
    Register("capture_size", 0x420, "ro", "CAPTURE_WORDS", 32, "words of the memory"),
    Register(
        "sink_data", 0x500, "wo", 0, 32, "next 32 pixels of the planes to display, first in bit 0"
    ),
    Register("sink_run", 0x504, "wo", 0, 32, "planes to display from the next frame on"),
    Register(
        "sink_state",
        0x508,
        "ro",
        0,
        3,
        "state of the sink",
        fields=(
            Field("running", 0, 0, "planes are waiting or displayed"),
            Field("underrun", 1, 1, "a row was due before its words arrived"),
            Field("overflow", 2, 2, "words arrived that did not fit"),
        ),
    ),
    Register("sink_level", 0x50C, "ro", 0, 32, "words waiting"),
    Register("sink_rows", 0x510, "ro", 0, 32, "rows displayed since the clear"),
    Register(
        "sink_crc", 0x514, "ro", 0, 32, "CRC-32 of the displayed words, most significant byte first"
    ),
    Register("sink_underruns", 0x518, "ro", 0, 32, "words that were due before they arrived"),
    Register("sink_lost", 0x51C, "ro", 0, 32, "words that did not fit"),
    Register("sink_size", 0x520, "ro", "SINK_WORDS", 32, "words of the memory"),
    Register("sink_clear", 0x524, "wo", 0, 1, "1 empties the sink and clears its counters"),
)

MEMORIES: tuple[Memory, ...] = (
    Memory(
        "identifier_mem",
        0x0000_0800,
        "IDENTIFIER_BYTES",
        "ro",
        "one character in each word, NUL at the end",
    ),
    Memory(
        "pattern_mem",
        0x0010_0000,
        "PATTERN_BYTES",
        "rw",
        "electrons of each pixel in a 40 kHz tick, a byte each, the first in bits 7 to 0; "
        "rows are padded to whole tiles",
    ),
    # Two address bits from every word above, so that one wrong bit of an address on a serial line
    # still leads to a bus error.
    Memory(
        "write_mem",
        0x5000_0000,
        "WRITE_BYTES",
        "rw",
        "numbered writes: number, byte address (bit 0: all to this address), count, words; "
        "performed once, and only if the number is the next one. Word 0 reads as the next number, "
        "word 1 as the count of those that arrived; ctrl_reset does not clear them",
    ),
    Memory(
        "capture_mem",
        0x6000_0000,
        "CAPTURE_BYTES",
        "ro",
        "the capture memory by address, the oldest word first; 0 beyond the end. A read does not "
        "move capture_pointer",
    ),
)


def mask(register: str, field: str) -> int:
    """Bit mask of a field in its register. Raises StopIteration for an unknown name."""
    entry = next(entry for entry in REGISTERS if entry.name == register)
    bits = next(each for each in entry.fields if each.name == field)
    return (2 << bits.high) - (1 << bits.low)


def quantum(level: int) -> int:
    """Threshold of a level of `sensor_threshold`, 0 to 15, electrons."""
    return 255 + 256 * level


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
