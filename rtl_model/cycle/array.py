"""The pixel array with its pattern memory: state between clocks, scanned by the compiled kernel."""

from __future__ import annotations

from collections import deque

import numpy as np

from rtl_model.cycle import scan
from rtl_model.cycle.tiles import TILE, Tiles
from rtl_model.geometry import Geometry
from rtl_model.registers import REGISTERS, parameters, reset_value

__all__ = ["PixelArray"]

_NO_TILES: Tiles = np.empty(0, TILE)
_TILES_AT_ONCE = 1 << 18  # of one call of the kernel: 6 MiB of tiles

_READ_AHEAD = 2
"""The memory is read one clock before a tile is computed, so a write at edge w is first seen by the
tile at edge w + 2."""


class PixelArray:
    """Charge, registers `sensor_*` and the frame under way."""

    def __init__(self, geometry: Geometry) -> None:
        self.geometry = geometry
        self._tiles = geometry.rows * geometry.tiles  # of a frame
        self._row_clocks, self._tick_minimum = geometry.row_clocks, geometry.tick_minimum
        wide = geometry.tiles * geometry.lanes
        self.memory = np.zeros((geometry.rows, wide), np.uint8)  # as the bus sees it
        self._seen = self.memory.copy()  # as the scan sees it
        self._late: deque[tuple[int, int]] = deque()  # (first edge that sees it, word)
        self._charge = np.zeros((geometry.rows, wide), np.int32)
        self.reset()

    def reset(self) -> None:
        """Registers as after reset, no frame under way, a clear pending; the memory stays."""
        values = parameters(self.geometry)
        resets = {entry.name: reset_value(entry, values) for entry in REGISTERS}
        self._registers = np.array([resets[name] for name in scan.REGISTERS], np.int64)
        self._state = np.zeros(scan.STATE, np.int64)
        self._state[scan.CLEAR] = 1
        self._state[scan.LAST] = -1

    def register(self, name: str) -> int:
        """Returns a register that is written and read."""
        return int(self._registers[scan.REGISTERS.index(name)])

    def set_register(self, name: str, value: int) -> None:
        """Writes such a register."""
        self._registers[scan.REGISTERS.index(name)] = value

    def clear(self) -> None:
        """The next frame is number 0 and starts from no charge."""
        self._state[scan.CLEAR] = 1

    @property
    def frames(self) -> int:
        """Frames begun since the clear."""
        return int(self._state[scan.FRAMES])

    @property
    def frame_clock(self) -> int:
        """Edge at which the last frame began; 0 before the first."""
        return int(self._state[scan.START])

    def rows_read(self, clock: int) -> int:
        """Rows inside the window read since the clear, as seen at `clock`: the last tile of a row
        counts an edge after it was computed."""
        late = self._state[scan.LAST] == clock - 1 and self._state[scan.LAST_ENDS]
        return int(self._state[scan.ROWS_READ] - late)

    def spikes(self, clock: int) -> int:
        """Spikes read since the clear, modulo 2^32, as seen at `clock`; late like the rows."""
        late = self._state[scan.LAST_SPIKES] if self._state[scan.LAST] == clock - 1 else 0
        return int(self._state[scan.SPIKES] - late)

    @property
    def period(self) -> int:
        """Clocks of a frame that would begin now."""
        registers = self._registers
        tick = max(int(registers[scan.TICK]), self._tick_minimum)
        return tick << int(registers[scan.CLOCK_SELECT])

    def next_frame(self, clock: int) -> int | None:
        """Returns the edge at or after `clock` at which a frame begins or, while one is under way,
        may begin; None where none will."""
        if self._state[scan.ACTIVE] and clock < self._state[scan.END]:
            return int(self._state[scan.END])
        return clock if self._registers[scan.RUN] else None

    def word(self, index: int) -> int:
        """Returns word `index` of the pattern memory."""
        return int.from_bytes(
            self.memory.reshape(-1)[4 * index : 4 * index + 4].tobytes(), "little"
        )

    def set_word(self, clock: int, index: int, value: int) -> None:
        """Writes word `index` of the pattern memory at edge `clock`."""
        pixels = np.frombuffer(value.to_bytes(4, "little"), np.uint8)
        self.memory.reshape(-1)[4 * index : 4 * index + 4] = pixels
        self._late.append((clock + _READ_AHEAD, index))

    def stop(self, clock: int, stop: int) -> int:
        """Returns how far `run` may go at once from `clock` towards `stop`."""
        while self._late and self._late[0][0] <= clock:
            _, index = self._late.popleft()
            part = slice(4 * index, 4 * index + 4)
            self._seen.reshape(-1)[part] = self.memory.reshape(-1)[part]
        if self._late:
            stop = min(stop, self._late[0][0])
        if self._idle(stop):
            return stop
        return min(stop, clock + max(1, _TILES_AT_ONCE // self._tiles) * self.period)

    def run(self, clock: int, stop: int) -> Tiles:
        """Runs edges `clock` to `stop` - 1 and returns the tiles computed; `stop` as `self.stop`
        gave it, or less."""
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
            self._seen,
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
        """Whether no frame begins and no tile is computed before edge `stop`: then the kernel,
        whose call alone takes longer than a byte on the line, would change nothing."""
        state, size = self._state, self.geometry
        if not state[scan.ACTIVE]:
            return not self._registers[scan.RUN]
        row = int(state[scan.ROW])
        if row >= size.rows:
            return stop <= int(state[scan.END])
        tile = int(state[scan.START]) + 1 + row * size.row_clocks + int(state[scan.INDEX])
        return stop <= tile
