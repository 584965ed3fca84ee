"""The row scan: its window, the times at which its blocks leave the chip, and its kernel with a
reference in numpy.

The plane that is latched in cycle k is read during cycle k + 1, block by block, at 40.96 Gbit/s. At
this rate, 1000 rows of 1024 bits take exactly one cycle at 40 kHz. It is assumed that the scan
starts at the edge of the cycle and does not pause; no publication states this.
"""

from __future__ import annotations

from importlib.resources import files
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from cosim import Clock, InputError
from cosim.clock import PS
from cosim.compute.opencl import Device
from cosim.config.amounts import at_most
from cosim.files.raw import BLOCK_BYTES, FRAME_BYTES, HALF, RAW_SIZE, TABLE, Table, markers
from cosim.spikes.viform import Words, unpack_planes, words_for

Bytes = npt.NDArray[np.uint8]
BIT_RATE: Final = FRAME_BYTES * 8 * 40_000
"""Rate of the chip's output, bit/s: 40.96 Gbit/s."""
BLOCK_PS: Final = BLOCK_BYTES * 8 * PS // BIT_RATE
"""Duration of a block of 512 bits, ps: exactly 12 500."""
_LOCAL: Final = 8
"""Blocks of a work-group; a fixed size lets PoCL compile the kernel only once."""


class Window(NamedTuple):
    """A window, in the format of the board's registers.

    Rows outside the window are not read: the output lacks their blocks, and the scan is shorter.
    Columns outside the window read 0, because a row is always read completely.

    Attributes:
        rows, columns: (first, last), both inclusive.
    """

    rows: tuple[int, int] = (0, RAW_SIZE[1] - 1)
    columns: tuple[int, int] = (0, RAW_SIZE[0] - 1)

    def checked(self) -> Window:
        """The window itself. Raises InputError if it is empty or exceeds the chip."""
        for name, (first, last), size in (
            ("rows", self.rows, RAW_SIZE[1]),
            ("columns", self.columns, RAW_SIZE[0]),
        ):
            if not 0 <= first <= last < size:
                raise InputError(
                    f"the window's {name}", f"first to last within 0 to {size - 1}",
                    f"{first} to {last}", "give others",
                )  # fmt: skip
        return self

    @property
    def read(self) -> npt.NDArray[np.intp]:
        """Blocks of a full frame that are read, in the order of the output, (blocks,) intp."""
        return np.flatnonzero((TABLE.row >= self.rows[0]) & (TABLE.row <= self.rows[1]))

    @property
    def places(self) -> npt.NDArray[np.uint32]:
        """Half row of the chip, 2 row + half, of each block, (blocks,) uint32."""
        return (TABLE.row * 2 + TABLE.half)[self.read].astype(np.uint32)

    @property
    def markers(self) -> npt.NDArray[np.uint16]:
        """Marker in the last 16 bits of each block, (blocks,) uint16."""
        return markers(Table(*(column[self.read] for column in TABLE)))

    @property
    def open(self) -> npt.NDArray[np.bool_]:
        """Columns that may fire, by half row, (2, pixels of a block) bool."""
        column = np.arange(RAW_SIZE[0])
        inside = (column >= self.columns[0]) & (column <= self.columns[1])
        return inside.reshape(2, HALF)


class ScanTiming:
    """Timing of the scan of a window.

    Args:
        clock: clock of the latch cycles.
        window: window that is read; the whole chip if None.

    Attributes:
        clock, window: clock and window as above.
        blocks: number of blocks in a cycle.

    Raises:
        InputError: if the scan takes longer than a cycle.
    """

    def __init__(self, clock: Clock, window: Window | None = None) -> None:
        self.clock = clock
        self.window = Window() if window is None else window.checked()
        self.blocks = len(self.window.read)
        least = PS * clock.den // clock.num  # shortest cycle, because edges are rounded down
        if self.scan_ps > least:
            raise InputError(
                "the clock of a readout",
                f"at most {at_most(PS / self.scan_ps)} Hz, at which {self.blocks // 2} rows are "
                "read in a cycle",
                f"{clock.hz:g} Hz", "lower it or read fewer rows",
            )  # fmt: skip

    @property
    def scan_ps(self) -> int:
        """Duration of a scan and so of the shortest cycle, ps: 25 000 for each row."""
        return self.blocks * BLOCK_PS

    def starts(self, cycle: int) -> npt.NDArray[np.int64]:
        """Start of each block of a cycle's plane, (blocks,) int64 ps. A block takes `BLOCK_PS`."""
        return self.clock.edge(cycle + 1) + BLOCK_PS * np.arange(self.blocks, dtype=np.int64)


def read_in_numpy(words: Words, cycles: int, window: Window | None = None) -> npt.NDArray[np.uint8]:
    """Raw bytes of the chip's output, (cycles, blocks, 64) uint8.

    Args:
        words: spike words, (n, 1000, 1000) uint32.
        cycles: number of latch cycles.
        window: window that is read; the whole chip if None.
    """
    window = Window() if window is None else window.checked()
    halves = unpack_planes(words, 0, cycles).reshape(cycles, 2 * RAW_SIZE[1], HALF)
    places = window.places
    bits = np.zeros((cycles, len(places), BLOCK_BYTES * 8), np.uint8)
    bits[..., :HALF] = halves[:, places] & window.open[places % 2]
    raw = np.packbits(bits, axis=2, bitorder="little")
    raw[..., -2:] |= window.markers.astype("<u2").view(np.uint8).reshape(-1, 2)
    return raw


class Readout:
    """The row scan of a window.

    Args:
        device: OpenCL device.
        window: window that is read; the whole chip if None. Raises InputError for one outside the
            chip.

    Attributes:
        window: window that is read.
        blocks: number of blocks in a cycle.
    """

    def __init__(self, device: Device, window: Window | None = None) -> None:
        self.window = Window() if window is None else window.checked()
        source = (files("rtl_model.readout") / "scan.cl").read_text(encoding="utf-8")
        options = ("-cl-std=CL1.2", f"-DLOCAL={_LOCAL}")
        self._device, self._kernel = device, device.kernel(source, "scan", options)
        places = self.window.places
        self.blocks = len(places)
        bits = np.zeros((2, BLOCK_BYTES * 8), bool)
        bits[:, : self.window.open.shape[1]] = self.window.open
        mask = np.packbits(bits, axis=1, bitorder="little")
        self._tables = [device.upload(table) for table in (places, self.window.markers, mask)]

    def read(self, words: Words, cycles: int, into: Bytes | None = None) -> Bytes:
        """Raw bytes in the order in which they leave the chip, (cycles, blocks, 64) uint8.

        Args:
            words: spike words of the cycles, (n, 1000, 1000) uint32.
            cycles: number of latch cycles.
            into: array for the result, which streaming callers reuse; a new one if None.

        Raises:
            ValueError: for another shape or dtype.
        """
        shape = (words_for(cycles), *RAW_SIZE[::-1])
        if cycles < 1 or words.shape != shape or words.dtype != np.uint32:
            raise ValueError(f"words must be {shape} uint32, not {words.shape} {words.dtype}")
        size = (cycles, self.blocks, BLOCK_BYTES)
        raw = np.empty(size, np.uint8) if into is None else into
        if raw.shape != size or raw.dtype != np.uint8 or not raw.flags.c_contiguous:
            raise ValueError(f"bytes must be {size} uint8, not {raw.shape} {raw.dtype}")
        device, contiguous = self._device, np.ascontiguousarray(words)
        source = device.share(contiguous)
        result = device.target(raw)
        across = -(-self.blocks // _LOCAL) * _LOCAL
        self._kernel(
            device.queue, (across, len(words)), (_LOCAL, 1), source, *self._tables, result,
            np.uint32(self.blocks), np.uint32(cycles),
        )  # fmt: skip
        device.settle(result, raw)
        return raw
