"""Size and clock rates of one build of the board: the parameters of the Verilog."""

from __future__ import annotations

from typing import NamedTuple


class Geometry(NamedTuple):
    """Parameters of a build.

    `columns` need not be a multiple of `lanes`. The last tile of a row is padded with pixels that
    never fire.

    Attributes:
        rows: rows of pixels, 1 to 4095.
        columns: columns of pixels, 1 to 4096.
        lanes: pixels computed in one clock, 32 or 64.
        clock_hz: the board's clock, Hz.
        baud: baud of the serial line.
        capture_words, sink_words: sizes of the two memories, words, powers of two.
    """

    rows: int = 32
    columns: int = 32
    lanes: int = 32
    clock_hz: int = 48_000_000
    baud: int = 115_200
    capture_words: int = 4096
    sink_words: int = 1024

    @property
    def tiles(self) -> int:
        """Tiles of `lanes` pixels in a row."""
        return -(-self.columns // self.lanes)

    @property
    def row_clocks(self) -> int:
        """Clocks from the first tile of a row to that of the next row.

        It is one more than the capture memory needs to store a row.
        """
        return self.row_words + 4

    @property
    def tick_minimum(self) -> int:
        """Shortest tick, clocks: all rows, and four in which the last tile leaves the pipeline and
        the next frame begins."""
        return self.rows * self.row_clocks + 4

    @property
    def tick_clocks(self) -> int:
        """Clocks of a 40 kHz tick after reset."""
        return max(self.clock_hz // 40_000, self.tick_minimum)

    @property
    def bit_clocks(self) -> int:
        """Clocks of a bit on the serial line, rounded."""
        return (self.clock_hz + self.baud // 2) // self.baud

    @property
    def row_words(self) -> int:
        """32-bit words of a row in the capture and sink memories, in whole tiles."""
        return self.tiles * self.lanes // 32

    @property
    def record_words(self) -> int:
        """Words of a captured row: sequence number, frame and row number, bits, CRC-32."""
        return self.row_words + 3

    @property
    def pattern_bytes(self) -> int:
        """Bytes of the pattern memory, in rows of whole tiles."""
        return self.rows * self.tiles * self.lanes

    @property
    def verilog(self) -> dict[str, int]:
        """Parameters of the Verilog by name, except BUILD."""
        return {
            "ROWS": self.rows,
            "COLUMNS": self.columns,
            "LANES": self.lanes,
            "CLOCK_HZ": self.clock_hz,
            "BIT_CLOCKS": self.bit_clocks,
            "CAPTURE_WORDS": self.capture_words,
            "SINK_WORDS": self.sink_words,
        }
