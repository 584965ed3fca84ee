"""Frames of a board, exactly as many as asked for.

A frame begins where `sensor_run` is 1 while none is under way, and a begun one is finished. So the
host writes 1 and 0, one word after the other in one packet, and the tick is made longer than a word
takes on the line: such a pulse makes one frame, or none where the one before has not ended, and
never two. What the board counts says how many are still to be made. The tick is then not the 40 kHz
one: a board that is stepped makes the planes of the ticks, not their time.
"""

from __future__ import annotations

from itertools import pairwise
from math import ceil
from typing import Final

from rtl_model.host import Board, BoardInfo, Cause, LineFault

__all__ = ["Stepper"]

_TICK_WORDS: Final = 6
"""Words that a tick lasts at least: a pulse is one, and the line may falter a little."""
_APART: Final = 4 / 3
"""From pulse to pulse, in ticks."""
_PACKET: Final = 240
"""Words of a packet at most."""
_PROBED: Final = 8
"""Words read to learn how many clocks one takes on the line; a simulated line may take none."""
_STALLS: Final = 100
"""Packets in a row without a frame before it is given up."""


class Stepper:
    """The sensor's clock in the host's hand. From `restart` on, `frames` have been made."""

    def __init__(self, board: Board, info: BoardInfo) -> None:
        self._board, self._info = board, info
        self._run = board.csr.register("sensor_run").address
        self.frames = 0

    def restart(self) -> None:
        """Stops the sensor; its next frame is number 0 and starts from no charge."""
        board = self._board
        was = board.read_twice("sensor_tick_clocks")
        board.write("sensor_run", 0)
        clocks = max(was, board.read_twice("sensor_tick_minimum"))
        slow = board.read_twice("sensor_clock_select")
        board.bone.pause((clocks << slow) / self._info.clock_hz * board.bone.time_scale)
        board.write("sensor_clock_select", 0)
        word = self._word_clocks()
        self._tick = max(board.read_twice("sensor_tick_minimum"), _TICK_WORDS * word)
        self._apart = min(max(ceil(_APART * self._tick / word), _TICK_WORDS + 2), _PACKET)
        board.write("sensor_tick_clocks", self._tick)
        board.write("sensor_clear", 1)
        self.frames = 0

    def step(self, frames: int) -> None:
        """Makes so many frames and waits until the last has ended. LineFault where they cannot be
        had, or where a pause of the line made one too many."""
        target, stalls = self.frames + frames, 0
        while self.frames < target:
            # The count is of before the clear until a first frame has begun.
            most = 1 if self.frames == 0 else _PACKET // self._apart
            pulses = min(target - self.frames, most)
            words = [1, *[0] * (self._apart - 1)] * pulses
            self._board.verified_write(self._run, words, fixed=True)
            made = self._board.read_twice("sensor_frames")
            if made > self.frames + pulses:
                raise LineFault(
                    Cause.LATE,
                    f"the board made {made - self.frames} frames of {pulses} pulses: the line "
                    "stood still within a packet",
                )
            stalls = 0 if made > self.frames else stalls + 1
            if stalls > _STALLS:
                raise LineFault(Cause.LATE, f"frame {self.frames} of the board does not begin")
            self.frames = made
        seconds = self._tick / self._info.clock_hz
        self._board.bone.pause(seconds * self._board.bone.time_scale)

    def _word_clocks(self) -> int:
        """Clocks of the board from one word on the line to the next, the most of a few."""
        place = self._board.csr.register("ctrl_uptime").address
        times = self._board.bone.read(place, _PROBED, fixed=True, retry=True)
        return max(1, *(b - a & 0xFFFFFFFF for a, b in pairwise(times)))
