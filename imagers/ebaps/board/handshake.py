"""The link between the board's two FPGAs: a line at a time, under a handshake of four phases.

Document 002, sections 2 and 3: the master FPGA works with the sensor, the slave FPGA with the
display, and they exchange data by a handshake, over lines of equal length, without loss. It prints
no protocol. Assumed: the master raises REQ when it has a line, the slave raises ACK when it has
room for one, the master sends the line with its own clock, one value per edge, and lowers REQ, and
the slave lowers ACK. Each FPGA has a clock of its own and samples the other's flag with two flip-
flops. The slave stores the line in a FIFO that the master's clock writes, and begins to show a line
when it has all of it, since LVAL must not pause.

From a change of REQ to the answer that the master acts on, each side takes two of its periods
after the first edge that sees the change. That edge comes within a period, or within two where a
sample falls into the change:

    2 (T_m + T_s) <= t <= 4 (T_m + T_s),    W T_m + 2 t for a line of W values.

A handshake for each value allows 5.0 to 9.4 Mvalue/s at 85 MHz, less than the 39.3 Mpixel/s of the
sensor. Hence a whole line.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Final

import numpy as np
import numpy.typing as npt

from cosim.clock import PS
from imagers.ebaps.board.fifo import AsyncFifo, Coin, edges_of

FIFO_VALUES: Final = 2048
"""Depth of the slave's FIFO, values of 16 bits: assumed (one block memory of 36 Kbit)."""
WINDOW_PS: Final = 200
"""Time around a flag's change, in which a sample may go either way."""
_MARGIN: Final = 8
"""Values that the slave's view of its FIFO may be late by."""

Image = npt.NDArray[np.uint16]


def answer_ps(master_hz: int, slave_hz: int) -> tuple[float, float]:
    """Least and most time from a change of REQ to the master's reaction to ACK, ps, where the slave
    has room."""
    both = PS / master_hz + PS / slave_hz
    return 2 * both, 4 * both


def values_a_second(master_hz: int, slave_hz: int, columns: int) -> tuple[float, float]:
    """Least and most rate of values under one handshake for each `columns` values, 1/s."""
    least, most = answer_ps(master_hz, slave_hz)
    sent = columns * PS / master_hz
    return columns * PS / (sent + 2 * most), columns * PS / (sent + 2 * least)


class _Flag:
    """REQ or ACK, with the other FPGA's two flip-flops."""

    def __init__(self, coin: Coin) -> None:
        self.up = False
        self._changed = -(10**18)
        self._coin = coin
        self._stages = [False, False]

    def set(self, now: int, up: bool) -> None:
        self.up, self._changed = up, now

    def seen(self, now: int) -> bool:
        """An edge of the other clock: the second flip-flop before it."""
        sample = self.up
        if now - self._changed < WINDOW_PS:
            sample = bool(self._coin.word() & 1)
        out = self._stages[1]
        self._stages = [sample, self._stages[0]]
        return out


@dataclass
class HandOver:
    """Result for a frame.

    Attributes:
        image: (H, W) values as the slave shows them; None if some did not arrive.
        answers: ps from each change of REQ to the master's reaction to ACK.
        stored: ps from a line's REQ to its last value in the slave's FIFO.
        ps: time from the first REQ to the end.
        overflows: overflows of the slave's FIFO.
        most: largest number of values in it.
    """

    image: Image | None = None
    answers: list[int] = field(default_factory=list)
    stored: list[int] = field(default_factory=list)
    ps: int = 0
    overflows: int = 0
    most: int = 0


class _Master:
    """States: 0 asks, 1 waits for ACK, 2 sends, 3 waits for its fall."""

    def __init__(self, image: Image, request: _Flag, acknowledge: _Flag, out: HandOver) -> None:
        self._lines = image.tolist()
        self._request, self._acknowledge, self._out = request, acknowledge, out
        self._line = self._at = self._state = self._since = self._asked = 0

    def edge(self, now: int, fifo: AsyncFifo) -> None:
        """An edge of the master's clock, which also writes the slave's FIFO."""
        granted = self._acknowledge.seen(now)
        value = None
        if self._state == 0 and self._line < len(self._lines) and not granted:
            self._ask(now, True, 1)
            self._asked = now
        elif self._state == 1 and granted:
            self._out.answers.append(now - self._since)
            self._state = 2
        elif self._state == 3 and not granted:
            self._out.answers.append(now - self._since)
            self._state = 0
        if self._state == 2:
            row = self._lines[self._line]
            value = row[self._at]
            self._at += 1
            if self._at == len(row):
                self._out.stored.append(now - self._asked)
                self._line, self._at = self._line + 1, 0
                self._ask(now, False, 3)
        fifo.write_edge(now, value)

    def _ask(self, now: int, up: bool, state: int) -> None:
        self._request.set(now, up)
        self._since, self._state = now, state


class _Slave:
    def __init__(self, columns: int, request: _Flag, acknowledge: _Flag) -> None:
        self._columns, self._left = columns, 0
        self._request, self._acknowledge = request, acknowledge
        self.values: list[int] = []

    def edge(self, now: int, fifo: AsyncFifo) -> None:
        asked = self._request.seen(now)
        if asked and not self._acknowledge.up:
            if fifo.waiting + self._columns + _MARGIN <= fifo.depth:
                self._acknowledge.set(now, True)
        elif not asked and self._acknowledge.up:
            self._acknowledge.set(now, False)
        pause = not self._left  # a clock with LVAL low between lines
        if pause and fifo.waiting >= self._columns:
            self._left = self._columns
        value = fifo.read_edge(now, bool(self._left) and not pause)
        if value is not None:
            self.values.append(value)
            self._left -= 1


def hand_over(
    image: Image, master_hz: int, slave_hz: int, *, phase_ps: int = 0, seed: int = 0
) -> HandOver:
    """A frame of (H, W) uint16, W up to 2040, from the master to the slave, clock by clock.

    phase_ps: first edge of the slave's clock. seed: of samples within the window.
    """
    rows, columns = image.shape
    if columns + _MARGIN > FIFO_VALUES:
        raise ValueError(f"a line must have at most {FIFO_VALUES - _MARGIN} values, not {columns}")
    request, acknowledge = _Flag(Coin(seed, 3)), _Flag(Coin(seed, 4))
    fifo = AsyncFifo(FIFO_VALUES, prog_empty=columns, prog_full=FIFO_VALUES, seed=seed)
    out = HandOver()
    master = _Master(image, request, acknowledge, out)
    slave = _Slave(columns, request, acknowledge)
    # Each line is sent, and shown, within this time; a longer run would be a fault of the model.
    longest = 2 * (columns + 20) * (PS // master_hz + PS // slave_hz) * (rows + 1)
    clocks = {"master": master_hz, "slave": slave_hz}
    for now, name in edges_of(clocks, {"slave": phase_ps}):
        if name == "master":
            master.edge(now, fifo)
        else:
            slave.edge(now, fifo)
            if len(slave.values) == image.size or now > longest:
                out.ps = now
                break
    out.overflows, out.most = fifo.overflows, fifo.most
    if len(slave.values) == image.size:
        out.image = np.array(slave.values, np.uint16).reshape(image.shape)
    return out
