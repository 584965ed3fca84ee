"""The pixel array with its pattern memory, scanned by the compiled kernel.

Its output are tiles: `lanes` pixels of one row, computed in one clock.
"""

from __future__ import annotations

from collections import deque
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from rtl_model.cycle import scan
from rtl_model.geometry import Geometry
from rtl_model.registers import REGISTERS, parameters, reset_value

TILE = np.dtype(
    [("clock", "<u8"), ("frame", "<u4"), ("row", "<u2"), ("tile", "<u2"), ("bits", "<u8")]
)
"""A tile. `clock` is the edge at which it was computed, `frame` counts from the clear, and bit b of
`bits` is the spike of column tile * lanes + b."""
Tiles: TypeAlias = npt.NDArray[np.void]
"""Array of `TILE`, in order of clock."""
_NO_TILES: Tiles = np.empty(0, TILE)
_TILES_AT_ONCE = 1 << 18  # most tiles of one call of the kernel, 6 MiB
_READ_AHEAD = 2
"""Clocks until a write takes effect: the memory is read one clock before a tile is computed, so a
write at edge w first affects the tile at edge w + 2."""


class PixelArray:
    """Charge, registers `sensor_*` and the frame in progress.

    Attributes:
        geometry: geometry of the build.
        memory: pattern memory as the bus reads it, (rows, padded columns) uint8.
    """

    def __init__(self, geometry: Geometry) -> None:
        self.geometry = geometry
        self._tiles = geometry.rows * geometry.tiles  # of a frame
        self._row_clocks, self._tick_minimum = geometry.row_clocks, geometry.tick_minimum
        wide = geometry.tiles * geometry.lanes
        self.memory = np.zeros((geometry.rows, wide), np.uint8)
        self._scanned = self.memory.copy()  # memory as the scan reads it
        self._pending: deque[tuple[int, int]] = deque()  # (edge of effect, word)
        self._charge = np.zeros((geometry.rows, wide), np.int32)
        self.reset()

    def reset(self) -> None:
        """Resets the registers and requests a clear; the memory is not changed."""
        values = parameters(self.geometry)
        resets = {entry.name: reset_value(entry, values) for entry in REGISTERS}
        self._registers = np.array([resets[name] for name in scan.REGISTERS], np.int64)
        self._state = np.zeros(scan.STATE, np.int64)
        self._state[scan.CLEAR] = 1
        self._state[scan.LAST] = -1

    def register(self, name: str) -> int:
        """The value of a writable register."""
        return int(self._registers[scan.REGISTERS.index(name)])

    def set_register(self, name: str, value: int) -> None:
        """Writes a register."""
        self._registers[scan.REGISTERS.index(name)] = value

    def clear(self) -> None:
        """Requests a clear: the next frame is number 0 and starts without charge."""
        self._state[scan.CLEAR] = 1

    def read_charges(self, exponent: int) -> None:
        """Requests a reading in 2 ** exponent levels, 1 to 7; 0 cancels a request."""
        self._state[scan.REQUEST] = exponent

    @property
    def passing(self) -> bool:
        """Whether the scan in progress, or the last one, is a pass of a reading."""
        return bool(self._state[scan.PASS])

    @property
    def number(self) -> int:
        """Number of the scan in progress: of the pass, or of the frame since the clear."""
        return int(self._state[scan.PASS]) or self.frames - 1

    @property
    def _scans(self) -> bool:
        """Whether another scan follows."""
        state = self._state
        return bool(self._registers[scan.RUN] or state[scan.PASSES] or state[scan.REQUEST])

    @property
    def frames(self) -> int:
        """Frames begun since the clear."""
        return int(self._state[scan.FRAMES])

    @property
    def frame_clock(self) -> int:
        """Edge at which the last frame or pass began; 0 before the first."""
        return int(self._state[scan.START])

    def rows_read(self, clock: int) -> int:
        """Rows of the window read since the clear, as the register states at `clock`.

        The last tile of a row is counted one edge after it was computed.
        """
        pending = self._state[scan.LAST] == clock - 1 and self._state[scan.LAST_ENDS]
        return int(self._state[scan.ROWS_READ] - pending)

    def spikes(self, clock: int) -> int:
        """Spikes read since the clear, modulo 2^32, with the same delay as the rows."""
        pending = self._state[scan.LAST_SPIKES] if self._state[scan.LAST] == clock - 1 else 0
        return int(self._state[scan.SPIKES] - pending)

    @property
    def period(self) -> int:
        """Clocks of a frame or pass that begins now."""
        registers = self._registers
        tick = max(int(registers[scan.TICK]), self._tick_minimum)
        return tick << int(registers[scan.CLOCK_SELECT])

    def next_frame(self, clock: int) -> int | None:
        """The edge at or after `clock` at which a scan starts, or at which the present one ends.

        None if none follows.
        """
        if self._state[scan.ACTIVE] and clock < self._state[scan.END]:
            return int(self._state[scan.END])
        return clock if self._scans else None

    def word(self, index: int) -> int:
        """Word `index` of the pattern memory."""
        return int.from_bytes(
            self.memory.reshape(-1)[4 * index : 4 * index + 4].tobytes(), "little"
        )

    def set_word(self, clock: int, index: int, value: int) -> None:
        """Writes word `index` of the pattern memory at edge `clock`."""
        pixels = np.frombuffer(value.to_bytes(4, "little"), np.uint8)
        self.memory.reshape(-1)[4 * index : 4 * index + 4] = pixels
        self._pending.append((clock + _READ_AHEAD, index))

    def words(self, index: int, count: int) -> bytes:
        """Words of the pattern memory from `index` on, big-endian."""
        part = self.memory.reshape(-1)[4 * index : 4 * (index + count)]
        return part.view("<u4").astype(">u4").tobytes()

    def set_words(self, index: int, words: bytes) -> bool:
        """Writes words (big-endian) from `index` on if no scan can read them; returns whether."""
        if self._state[scan.ACTIVE] or self._scans or self._pending:
            return False
        pixels = np.frombuffer(words, ">u4").astype("<u4").view(np.uint8)
        for memory in (self.memory, self._scanned):
            memory.reshape(-1)[4 * index : 4 * index + pixels.size] = pixels
        return True

    def stop(self, clock: int, stop: int) -> int:
        """The edge up to which one call of `run` may go, at most `stop`."""
        while self._pending and self._pending[0][0] <= clock:
            _, index = self._pending.popleft()
            part = slice(4 * index, 4 * index + 4)
            self._scanned.reshape(-1)[part] = self.memory.reshape(-1)[part]
        if self._pending:
            stop = min(stop, self._pending[0][0])
        if self._idle(stop):
            return stop
        state = self._state
        if state[scan.PASS] or state[scan.PASSES] or state[scan.REQUEST]:
            # One scan a call, so that all its tiles are of a frame or all of a pass.
            within = state[scan.ACTIVE] and clock < state[scan.END]
            return min(stop, int(state[scan.END]) if within else clock + self.period)
        return min(stop, clock + max(1, _TILES_AT_ONCE // self._tiles) * self.period)

    def run(self, clock: int, stop: int) -> Tiles:
        """Runs edges `clock` to `stop` - 1; returns the computed tiles.

        `stop` must not exceed `self.stop(clock, stop)`.
        """
        if self._idle(stop):
            return _NO_TILES
        room = stop - clock
        if room > self._tiles:
            room = min(room, (room // self.period + 2) * self._tiles)
        tiles = np.empty(room, TILE)
        count = scan.scan(
            self._registers,
            self._state,
            self._charge,
            self._scanned,
            self.geometry.lanes,
            self.geometry.columns,
            self._row_clocks,
            self._tick_minimum,
            clock,
            stop,
            tiles,
        )
        return tiles[:count]

    def _idle(self, stop: int) -> bool:
        """Whether no frame starts and no tile is computed before edge `stop`.

        Then the kernel is not called, because a call takes longer than a byte on the line.
        """
        state, size = self._state, self.geometry
        if not state[scan.ACTIVE]:
            return not self._scans
        row = int(state[scan.ROW])
        if row >= size.rows:
            return stop <= int(state[scan.END])
        tile = int(state[scan.START]) + 1 + row * size.row_clocks + int(state[scan.INDEX])
        return stop <= tile


def rows_of(tiles: Tiles, geometry: Geometry) -> npt.NDArray[np.bool_]:
    """Spikes of complete rows, (rows, columns) bool.

    Args:
        tiles: tiles of complete rows, tile 0 first, as `System.run` returns them.
        geometry: geometry of the build.
    """
    bits = np.ascontiguousarray(tiles["bits"]).view(np.uint8).reshape(-1, 8)
    lanes = np.unpackbits(bits, axis=1, bitorder="little")[:, : geometry.lanes]
    return lanes.reshape(-1, geometry.tiles * geometry.lanes)[:, : geometry.columns].astype(bool)
