"""Frames of a board, exactly as many as asked for.

A frame begins where `sensor_run` is 1 while none is under way, and a begun one is finished. So the
host writes 1 and 0, one word after the other in one packet, and the tick is made longer than a word
takes on the line: such a pulse makes one frame, or none where the one before has not ended, and
never two. What the board counts says how many are still to be made. The tick is then not the 40 kHz
one: a board that is stepped makes the planes of the ticks, not their time.
"""

from __future__ import annotations

from typing import Final

from rtl_model.host import Board, BoardInfo, Cause, LineFault

__all__ = ["Stepper"]

_WORDS: Final = 8
"""From pulse to pulse."""
_TICK: Final = 6
"""Words that a tick lasts: more than the one of a pulse, fewer than the way to the next."""
_WORD_BITS: Final = 4 * 10
_PACKET: Final = 30
"""Pulses of a packet at most: 240 words."""
_STALLS: Final = 50
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
        bit = max(board.read_twice("uart_bit_clocks"), 1)
        self._tick = max(board.read_twice("sensor_tick_minimum"), _TICK * _WORD_BITS * bit)
        board.write("sensor_tick_clocks", self._tick)
        board.write("sensor_clear", 1)
        self.frames = 0

    def step(self, frames: int) -> None:
        """Makes so many frames and waits until the last has ended. LineFault where they cannot be
        had, or where a pause of the line made one too many."""
        target, stalls = self.frames + frames, 0
        while self.frames < target:
            # The count is of before the clear until a first frame has begun.
            pulses = 1 if self.frames == 0 else min(target - self.frames, _PACKET)
            self._board.verified_write(self._run, [1, *[0] * (_WORDS - 1)] * pulses, fixed=True)
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
