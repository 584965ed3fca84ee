"""A large pixel array with its state in an external memory (`viform_external.v`), edge by edge.

The pixels are those of `cycle.pixel`; only the course in time differs from that of `cycle.System`.
"""

from __future__ import annotations

from collections import deque
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from rtl_model.cycle import Settings
from rtl_model.cycle.planes import increments, step
from rtl_model.geometry import Geometry
from rtl_model.registers import quantum
from rtl_model.stream.ring import Fifo, Tile

_BITS = 20  # of a pixel in a word: 12 of charge, 8 of electrons a tick


class Command(NamedTuple):
    """A command to the memory.

    Attributes:
        write: direction: a write, or else a read.
        address: address of a word.
        data: data of a write.
    """

    write: bool
    address: int
    data: int


def pack(charge: npt.ArrayLike, electrons: npt.ArrayLike) -> int:
    """The memory word of some pixels, the first in the lowest bits."""
    pairs = zip(np.asarray(charge).tolist(), np.asarray(electrons).tolist(), strict=True)
    return sum((more << 12 | held) << _BITS * j for j, (held, more) in enumerate(pairs))


def state_words(geometry: Geometry, pixels: int, electrons: npt.NDArray[np.uint8]) -> list[int]:
    """The memory before the first frame, without charge.

    Args:
        geometry: geometry of the array.
        pixels: pixels of a word.
        electrons: pattern, (rows, columns).
    """
    wide = np.zeros((geometry.rows, geometry.tiles * geometry.lanes), np.int64)
    wide[:, : geometry.columns] = electrons
    return [pack([0] * pixels, part) for part in wide.reshape(-1, pixels)]


class Memory:
    """A synchronous memory: a word that is read arrives `latency` edges after its command.

    Args:
        words: contents.
        latency: latency of a read, edges, at least 1.
    """

    def __init__(self, words: list[int], latency: int) -> None:
        self.words = list(words)
        self._pipe: deque[int | None] = deque([None] * latency)

    @property
    def arriving(self) -> int | None:
        """The word before the next edge."""
        return self._pipe[0]

    def edge(self, command: Command | None) -> None:
        """A clock edge, at which a command is carried out unless None."""
        self._pipe.popleft()
        self._pipe.append(None)
        if command is not None and command.write:
            self.words[command.address] = command.data
        elif command is not None:
            self._pipe[-1] = self.words[command.address]


class ExternalArray:
    """The array without its memory.

    Args:
        geometry: geometry of the array; clock and memories are not used.
        pixels: pixels of a memory word.
        in_flight: most words between read and write.

    Attributes:
        command: command to the memory, before the next edge; None for none.
        tile: tile at the pins before the next edge; None for none.
        frames: frames begun since the clear.
        late: frames that began after they were due.
    """

    def __init__(self, geometry: Geometry, pixels: int, in_flight: int) -> None:
        self.geometry, self.pixels, self.in_flight = geometry, pixels, in_flight
        self._words = geometry.pattern_bytes // pixels
        self._row_words = self._words // geometry.rows
        self.command: Command | None = None
        self.tile: Tile | None = None
        self.frames = self.late = 0
        self._busy = self._overdue = False
        self._clear = True
        self._due = 0  # edge from which a frame may begin
        self._clock = 0
        self._asked = self._taken = self._written = self._words
        self._results: Fifo[int] = Fifo()
        self._result: int | None = None
        self._tile_bits = 0

    def edge(
        self, run: bool, clear: bool, tick: int, settings: Settings, word: int | None, ready: bool
    ) -> None:
        """A clock edge.

        Args:
            run, clear: whether frames begin; whether the next one is number 0, without charge.
            tick: clocks of a 40 kHz tick.
            settings: registers; sampled where a frame begins.
            word: word from the memory, None for none.
            ready: whether the memory takes the command.
        """
        written = self._written  # before this edge
        free = self.command is None or ready
        queued = self._results.out
        if free:
            self.command = self._next_command(queued)
        self._results.edge(self._result, free)
        self._take(word)
        self._frame(run, clear, tick, settings, busy=written < self._words)
        self._clock += 1

    def _next_command(self, queued: int | None) -> Command | None:
        if queued is not None:
            self._written += 1
            return Command(True, self._written - 1, queued)
        # A word in flight has been asked for and not written.
        if self._asked < self._words and self._asked - self._written < self.in_flight:
            self._asked += 1
            return Command(False, self._asked - 1, 0)
        return None

    def _take(self, word: int | None) -> None:
        """Computes a tick of the pixels of a word."""
        self._result = self.tile = None
        if word is None:
            return
        size, settings = self.geometry, self._settings
        row, place = divmod(self._taken, self._row_words)
        column = place * self.pixels + np.arange(self.pixels)
        fields = [word >> _BITS * j for j in range(self.pixels)]
        stored = np.array([field >> 12 & 0xFF for field in fields])
        charge = np.array([0 if self._fresh else field & 0xFFF for field in fields])
        electrons = increments(
            settings.pattern, settings.level, self._number, np.array(row), column, stored
        )
        rest, fired = step(
            charge, electrons << settings.clock_select, quantum(settings.threshold),
            settings.reset_rule,
        )  # fmt: skip
        assert settings.rows is not None and settings.columns is not None
        inside = settings.rows[0] <= row <= settings.rows[1]
        live = inside & (column >= settings.columns[0]) & (column <= settings.columns[1])
        live &= column < size.columns
        self._result = pack(np.where(live, rest, 0), stored)
        spikes = sum(int(spike) << j for j, spike in enumerate(fired & live))
        tile, lane = divmod(place * self.pixels, size.lanes)
        self._tile_bits = (self._tile_bits if lane else 0) | spikes << lane
        if inside and lane + self.pixels == size.lanes:
            self.tile = Tile(self._number, row, tile, self._tile_bits)
        self._taken += 1

    def _frame(self, run: bool, clear: bool, tick: int, settings: Settings, *, busy: bool) -> None:
        """Begins a frame that is due if none is in progress."""
        due = self._clock >= self._due
        if run and due and not busy:
            self.late += self._overdue
            self._overdue = False
            # The edge at which a frame begins sets the counter, so the shortest period is two.
            self._due = self._clock + max(2, max(tick, 1) << settings.clock_select)
            self._fresh, self._settings = self._clear, settings
            self._number = 0 if self._clear else self.frames
            self.frames = self._number + 1 & 0xFFFFFFFF
            self._clear = clear
            self._asked = self._taken = self._written = 0
        else:
            self._overdue |= due and busy
            self._clear |= clear
