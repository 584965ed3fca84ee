"""Stepping of a board: exactly as many frames as requested.

A frame starts when `sensor_run` is 1 and no frame is in progress. A started frame is completed. The
host writes 1 and then 0 in one packet, and the tick is longer than a word on the line. Such a pulse
starts one frame, or none if the previous frame has not ended, and never two. The board's frame
counter shows how many are missing. The tick is longer than at 40 kHz, so a stepped board computes
the planes of the ticks but does not run in real time.
"""

from __future__ import annotations

from itertools import pairwise
from math import ceil
from typing import Final

from rtl_model.host import Board, BoardInfo, Cause, LineFault

_TICK_WORDS: Final = 6
"""Shortest tick, words on the line. A pulse is one word, and the line may pause briefly."""
_APART: Final = 4 / 3
"""Distance of pulses, ticks."""
_PACKET: Final = 240
"""Most words of a packet."""
_PROBED: Final = 8
"""Words read to measure the clocks of one word; a simulated line may take none."""
_STALLS: Final = 100
"""Consecutive packets without a frame before a fault is raised."""


class Stepper:
    """Steps the sensor of a board.

    Attributes:
        frames: number of frames since `restart`.
    """

    def __init__(self, board: Board, info: BoardInfo) -> None:
        self._board, self._info = board, info
        self._run = board.csr.register("sensor_run").address
        self.frames = 0

    def restart(self) -> None:
        """Stops the sensor. Its next frame is number 0 and starts without charge."""
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
        """Runs the given number of frames and waits until the last has ended.

        Raises LineFault if a frame does not start, or if a pause of the line caused a surplus one.
        """
        target, stalls = self.frames + frames, 0
        while self.frames < target:
            # Until the first frame has begun, the counter holds its value before the clear.
            most = 1 if self.frames == 0 else _PACKET // self._apart
            pulses = min(target - self.frames, most)
            words = [1, *[0] * (self._apart - 1)] * pulses
            self._board.verified_write(self._run, words, fixed=True)
            count = self._board.read_twice("sensor_frames")
            if count > self.frames + pulses:
                raise LineFault(
                    Cause.LATE,
                    f"the board started {count - self.frames} frames by {pulses} pulses: the line "
                    "paused within a packet",
                )
            stalls = 0 if count > self.frames else stalls + 1
            if stalls > _STALLS:
                raise LineFault(Cause.LATE, f"frame {self.frames} of the board does not begin")
            self.frames = count
        seconds = self._tick / self._info.clock_hz
        self._board.bone.pause(seconds * self._board.bone.time_scale)

    def _word_clocks(self) -> int:
        """Clocks of the board from one word on the line to the next, the largest of several."""
        place = self._board.csr.register("ctrl_uptime").address
        times = self._board.bone.read(place, _PROBED, fixed=True, retry=True)
        return max(1, *(b - a & 0xFFFFFFFF for a, b in pairwise(times)))
