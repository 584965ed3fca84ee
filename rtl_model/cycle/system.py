"""The board behind its serial line, clock by clock, with every register and memory of the map.

Clock n is the n-th rising edge after reset, and "at clock n" means before that edge. A bus access
is strobed at an edge. A write affects later edges. A read returns the value before its edge. A
reset of the board does not clear its counters of the serial line.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable, Iterable

import numpy as np

from cosim import InputError
from rtl_model.cycle.array import TILE, PixelArray, Tiles
from rtl_model.cycle.memories import Capture, NumberedWrites, Sink, SinkTile
from rtl_model.geometry import Geometry
from rtl_model.prbs import Prbs
from rtl_model.registers import (
    MEMORIES,
    REGISTERS,
    WRITE_WORDS,
    identifier,
    parameters,
    reset_value,
)

_BY_ADDRESS = {register.address: register for register in REGISTERS}
_RESET = next(entry.address for entry in REGISTERS if entry.name == "ctrl_reset")
_SINK_DATA = next(entry.address for entry in REGISTERS if entry.name == "sink_data")
_MEMORY = {memory.name: memory for memory in MEMORIES}
_IDENTIFIER = _MEMORY["identifier_mem"].address
_PATTERN = _MEMORY["pattern_mem"].address
_WRITES = _MEMORY["write_mem"].address
_CAPTURED = _MEMORY["capture_mem"].address
_WORD = 0xFFFFFFFF


class System:
    """A board after power-on, at clock 0.

    Args:
        geometry: geometry of the build.
        build: contents of `ctrl_build`.
        keep: whether tiles are stored for `run`; not needed for a board that is only used over its
            line.

    Attributes:
        geometry: geometry of the build.
        line: counters of the serial line.
    """

    def __init__(self, geometry: Geometry | None = None, *, build: int = 0, keep: bool = True):
        self.geometry = Geometry() if geometry is None else geometry
        self.line = LineCounters()
        self._numbered = NumberedWrites()
        self._keep = keep
        self._tiles: list[Tiles] = []
        self._sink_tiles: list[SinkTile] = []
        self._clock = 0
        values = parameters(self.geometry, build)
        self._reset = {entry.name: reset_value(entry, values) for entry in REGISTERS}
        self._identifier = identifier(self.geometry).encode("ascii") + b"\0"
        self._array = PixelArray(self.geometry)
        self._power_on()
        self._readers = self._make_readers()
        self._writers = self._make_writers()

    def _power_on(self) -> None:
        self._array.reset()
        self._capture = Capture(self.geometry.capture_words)
        self._sink = Sink(self.geometry)
        self._scratch = self._reset["ctrl_scratch"]
        self._bus_errors = 0
        self._set_order(self._reset["prbs_order"])
        self._row: list[int] = []  # words of the captured row that is being read

    @property
    def clock(self) -> int:
        """Edges passed since power-on."""
        return self._clock

    def write(self, address: int, value: int) -> None:
        """Writes 32 bits at a byte address; takes one clock."""
        self._strobe_write(self._clock, address, value)

    def read(self, address: int) -> int:
        """Reads 32 bits at a byte address; takes two clocks."""
        self._capture.settle(self._clock)
        value = self._value(address)
        self.advance(self._clock + 2)
        return value

    def read_block(self, address: int, words: int) -> bytes | None:
        """Reads consecutive words of the pattern or the capture memory; takes two clocks each.

        Returns the words, big-endian, or None, without an access, for other addresses.
        """
        place, size = (address - _PATTERN) // 4, self.geometry.pattern_bytes // 4
        captured = (address - _CAPTURED) // 4
        if 0 <= place <= size - words:
            data = self._array.words(place, words)
        elif 0 <= captured <= self.geometry.capture_words - words and not self._capture.busy:
            self._capture.settle(self._clock)
            memory = self._capture.memory[captured : captured + words]
            memory += [0] * (words - len(memory))
            data = np.array(memory, ">u4").tobytes()
        else:
            return None
        self.advance(self._clock + 2 * words)
        return data

    def write_block(self, address: int, data: bytes) -> bool:
        """Writes consecutive words (big-endian), also as a numbered write, to the pattern memory.

        Takes a clock each. Returns False, without an access, for other writes, for a refused number
        and while the sensor runs.
        """
        target, words = address, data
        if address == _WRITES:
            whole = self._numbered.whole(data)
            if whole is None:
                return False
            target, words = whole
        place, size = (target - _PATTERN) // 4, self.geometry.pattern_bytes // 4
        if not 0 <= place <= size - len(words) // 4 or not self._array.set_words(place, words):
            return False
        if address == _WRITES:
            self._numbered.perform()
        self.advance(self._clock + len(data) // 4)
        return True

    def run(self, clocks: int, writes: Iterable[tuple[int, int, int]] = ()) -> Tiles:
        """Runs `clocks` clocks; returns the tiles computed since the last run.

        Args:
            clocks: number of clocks.
            writes: (clock, byte address, value) at clocks of this run, at most one each.

        Raises:
            InputError: for a write at another clock.
        """
        stop = self._clock + clocks
        for clock, address, value in sorted(writes, key=lambda write: write[0]):
            if not self._clock <= clock < stop:
                raise InputError(
                    "a write's clock",
                    f"one of {self._clock} to {stop - 1}, one write a clock",
                    str(clock),
                    "move the write",
                )
            self._strobe_write(clock, address, value)
        self.advance(stop)
        tiles = self._tiles
        self._tiles = []
        return np.concatenate(tiles) if tiles else np.empty(0, TILE)

    def sink_tiles(self) -> Tiles:
        """The tiles that the sink displayed since the last call; their frame is 0."""
        tiles, self._sink_tiles = self._sink_tiles, []
        return np.array([(clock, 0, *rest) for clock, *rest in tiles], TILE)

    def advance(self, stop: int) -> None:
        """Runs up to clock `stop`; does nothing if it has passed."""
        array, capture, sink = self._array, self._capture, self._sink
        while self._clock < stop:
            clock = self._clock
            end = array.stop(clock, stop)
            attentive = capture.armed or capture.active or sink.left or sink.active
            if attentive:
                capture.settle(clock)
                frame = array.next_frame(clock)
                if frame == clock:
                    self._frame_begins(clock)
                    frame = clock + array.period
                end = end if frame is None else min(end, frame)
            tiles = array.run(clock, end)
            if attentive:
                self._attend(tiles, end)
            if self._keep and tiles.size:
                self._tiles.append(tiles)
            self._clock = end

    def _frame_begins(self, clock: int) -> None:
        size = self.geometry
        self._row = []
        self._capture.frame_begins(clock + 1 + (size.rows + 1) * size.row_clocks + 4)
        self._sink.frame_begins(clock)

    def _attend(self, tiles: Tiles, stop: int) -> None:
        """Displays and captures the tiles of a frame before edge `stop`."""
        capture = self._capture
        sink_tiles = self._sink.run(stop)
        if self._keep:
            self._sink_tiles += sink_tiles
        if capture.takes and capture.taken == 1:
            for tile in sink_tiles:
                self._collect(tile.row, tile.tile, tile.bits)
        elif capture.takes:
            for row, index, bits in tiles[["row", "tile", "bits"]].tolist():
                self._collect(row, index, bits)

    def _collect(self, row: int, index: int, bits: int) -> None:
        size = self.geometry
        self._row += [bits >> 32 * n & _WORD for n in range(size.lanes // 32)]
        if index == size.tiles - 1:
            begun = self._array.frame_clock + 1 + row * size.row_clocks
            number = self._array.number
            self._capture.store(begun + 2 * size.row_clocks + 4, number, row, self._row)
            self._row = []

    def _strobe_write(self, clock: int, address: int, value: int) -> None:
        address, value = address & ~3, value & _WORD
        self.advance(clock)
        if 0 <= address - _WRITES < 4 * WRITE_WORDS:
            passed = self._numbered.write((address - _WRITES) // 4, value)
            if passed is None:
                self.advance(clock + 1)
                return
            address = passed
        if address == _RESET and value & 1:  # the scan has no edge during a reset
            self._power_on()
            self._clock = clock + 1
            return
        room = self._sink.room  # before a word is taken at this edge
        self.advance(clock + 1)
        register = _BY_ADDRESS.get(address)
        if address == _SINK_DATA:
            self._sink.push(value, room)
        elif register is not None:
            if register.mode != "ro":
                self._writers[register.name](value & ((1 << register.width) - 1))
        elif 0 <= address - _PATTERN < self.geometry.pattern_bytes:
            self._array.set_word(clock, (address - _PATTERN) // 4, value)
        elif not self._read_only(address):
            self._bus_errors += 1

    def _read_only(self, address: int) -> bool:
        """Whether an address is in a memory that ignores writes."""
        captured = 0 <= address - _CAPTURED < 4 * self.geometry.capture_words
        return captured or 0 <= address - _IDENTIFIER < 4 * len(self._identifier)

    def _value(self, address: int) -> int:
        address &= ~3
        register = _BY_ADDRESS.get(address)
        if register is not None:
            if register.mode == "wo":
                return 0
            reader = self._readers.get(register.name)
            return self._reset[register.name] if reader is None else reader() & _WORD
        if 0 <= address - _PATTERN < self.geometry.pattern_bytes:
            return self._array.word((address - _PATTERN) // 4)
        if 0 <= address - _CAPTURED < 4 * self.geometry.capture_words:
            return self._capture.word((address - _CAPTURED) // 4)
        if 0 <= address - _WRITES < 4 * WRITE_WORDS:
            return self._numbered.read((address - _WRITES) // 4)
        if 0 <= address - _IDENTIFIER < 4 * len(self._identifier):
            return self._identifier[(address - _IDENTIFIER) // 4]
        self._bus_errors += 1
        return 0

    def _make_readers(self) -> dict[str, Callable[[], int]]:
        """Functions that read the variable registers, by name."""
        readers: dict[str, Callable[[], int]] = {
            "ctrl_scratch": lambda: self._scratch,
            "ctrl_bus_errors": lambda: self._bus_errors,
            "ctrl_uptime": lambda: self._clock,
            "prbs_order": lambda: self._order,
            "prbs_source": lambda: self._source.word(),
            "prbs_checked": lambda: self._checked,
            "prbs_errors": lambda: self._errors,
            "sensor_frames": lambda: self._array.frames,
            "sensor_frame_clock": lambda: self._array.frame_clock,
            "sensor_rows_read": lambda: self._array.rows_read(self._clock),
            "sensor_spikes": lambda: self._array.spikes(self._clock),
            "capture_source": lambda: self._capture.source,
            "capture_state": lambda: self._capture.state,
            "capture_level": lambda: self._capture.level,
            "capture_data": lambda: self._capture.next(),
            "capture_pointer": lambda: self._capture.pointer,
            "capture_rows": lambda: self._capture.rows,
            "capture_lost": lambda: self._capture.lost,
            "sink_state": lambda: self._sink.state,
            "sink_level": lambda: len(self._sink.words),
            "sink_rows": lambda: self._sink.rows,
            "sink_crc": lambda: self._sink.crc,
            "sink_underruns": lambda: self._sink.underruns,
            "sink_lost": lambda: self._sink.lost,
        }
        for register in REGISTERS:
            group, name = register.name.split("_", 1)
            if group == "uart" and hasattr(self.line, name) and register.mode == "ro":
                readers[register.name] = lambda name=name: self.line.read(name)  # type: ignore[misc]
            if group == "sensor" and register.mode == "rw":
                readers[register.name] = lambda full=register.name: self._array.register(full)  # type: ignore[misc]
        return readers

    def _make_writers(self) -> dict[str, Callable[[int], None]]:
        writers: dict[str, Callable[[int], None]] = {
            "ctrl_scratch": self._set_scratch,
            "ctrl_reset": lambda value: None,
            "uart_clear": lambda value: self.line.clear() if value else None,
            "prbs_order": self._set_order,
            "prbs_check": self._check,
            "sensor_clear": lambda value: self._array.clear() if value else None,
            "sensor_reading": lambda value: self._array.read_charges(value),
            "capture_source": self._set_source,
            "capture_arm": lambda value: self._capture.arm(value),
            "capture_pointer": self._seek,
            "sink_run": self._show,
            "sink_clear": lambda value: self._sink.clear() if value else None,
        }
        for register in REGISTERS:
            if register.name.startswith("sensor_") and register.mode == "rw":
                writers[register.name] = lambda value, full=register.name: self._array.set_register(  # type: ignore[misc]
                    full, value
                )
        return writers

    def _set_scratch(self, value: int) -> None:
        self._scratch = value

    def _set_order(self, value: int) -> None:
        self._order = value
        self._source, self._checker = Prbs(value), Prbs(value)
        self._checked = self._errors = 0

    def _check(self, value: int) -> None:
        self._errors += (value ^ self._checker.word()).bit_count()
        self._checked += 1

    def _set_source(self, value: int) -> None:
        self._capture.source = value

    def _seek(self, value: int) -> None:
        self._capture.settle(self._clock)
        self._capture.seek(value)

    def _show(self, value: int) -> None:
        self._sink.left = value


class LineCounters:
    """The registers `uart_*`, as attributes without that prefix. They are read modulo 2^32."""

    def __init__(self) -> None:
        self.clear()

    def clear(self) -> None:
        """Sets all counters to their values after power-on."""
        self.rx_bytes = self.tx_bytes = 0
        self.framing_errors = self.watchdog_aborts = self.unknown_commands = 0
        self.writes = self.writes_crc = 0
        self.shortest_low = 0xFFFFFFFF

    def count_write(self, value: int) -> None:
        """Counts one word written over the line."""
        self.count_words(value.to_bytes(4, "big"))

    def count_words(self, data: bytes) -> None:
        """Counts words written over the line, big-endian."""
        self.writes += len(data) // 4
        self.writes_crc = zlib.crc32(data, self.writes_crc)

    def read(self, name: str) -> int:
        """The value of the register uart_`name`."""
        return int(getattr(self, name)) & 0xFFFFFFFF
