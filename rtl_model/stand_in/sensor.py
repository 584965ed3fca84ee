"""The board in the sensor's place: steps of charge in, spike planes out.

A pixel of the board gets a whole number of electrons, 0 to 255, in each tick, and fires at
255 + 256 k of them. A scene's light is scaled to that by its rate, light over threshold, so the
board's rate is off by at most half an electron over the threshold: the level k is the largest at
which the brightest light still fits.
"""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

from cosim import InputError
from rtl_model.host import Board, BoardInfo, Cause, LineFault, capture
from rtl_model.registers import mask, quantum
from rtl_model.stand_in.place import StandIn
from rtl_model.stand_in.stepping import Stepper

__all__ = ["BoardSensor", "level_for", "steps_of"]

LEVELS: Final = 16
STEP_MOST: Final = 255
FRAMES_MOST: Final = 1 << 20
"""Frames of a run: a captured row has 20 bits for their number."""
RESETS: Final = {"residual": 0, "hard": 1, "subtract": 2}
_DONE: Final = mask("capture_state", "done")
_POLLS: Final = 200

Planes = npt.NDArray[np.bool_]


def level_for(rate: float) -> int:
    """The threshold level at which `rate` spikes a tick, the most of a scene, is finest."""
    fits = [k for k in range(LEVELS) if rate * quantum(k) <= STEP_MOST]
    return max(fits, default=0)


def steps_of(
    rate: npt.NDArray[np.float64], level: int
) -> tuple[npt.NDArray[np.uint8], npt.NDArray[np.float64]]:
    """Electrons of the board for `rate` spikes a tick, and the error of the rate that they have; a
    pixel of more than a spike a tick fires at every one either way."""
    wanted = np.minimum(rate, 1.0)
    steps = np.minimum(np.rint(wanted * quantum(level)), STEP_MOST)
    return steps.astype(np.uint8), steps / quantum(level) - wanted


class BoardSensor:
    """An open board made ready: stopped, without charge, all its pixels read, at this threshold
    level and reset rule. InputError where its memory does not hold a frame, or `frames` are more
    than it can number.

    bytes: captured so far. wrong_bits: that differ from the cycle model's. uploads: of the pattern
    memory.
    """

    def __init__(self, place: StandIn, level: int, reset: str, frames: int) -> None:
        self._board, self._info = place.board, place.info
        info, size = place.info, place.info.geometry
        need = size.record_words * size.rows
        self.burst = info.capture_words // need
        if self.burst < 1:
            raise InputError(
                place.name, f"one whose capture memory holds a frame, {need} words",
                f"one of {info.capture_words} words", "build it with a larger CAPTURE_WORDS",
            )  # fmt: skip
        if frames > FRAMES_MOST:
            raise InputError(
                "duration", f"at most {FRAMES_MOST} cycles, which {place.name} can number",
                f"{frames} cycles", "shorten it",
            )  # fmt: skip
        self.bytes = self.wrong_bits = self.uploads = 0
        self._level, self._reset = level, RESETS[reset]
        self._stepper = Stepper(self._board, info)
        self._shown: npt.NDArray[np.uint8] | None = None
        self._charge = np.zeros((info.rows, info.columns), np.int64)
        _set_up(self._board, info, level, self._reset)
        self._stepper.restart()

    def expose(self, steps: npt.NDArray[np.uint8], ticks: int) -> Planes:
        """Spikes of the next `ticks` ticks, in each of which the pixels get (rows, columns) uint8
        electrons: (ticks, rows, columns)."""
        from rtl_model.host import pattern

        if self._shown is None or not np.array_equal(steps, self._shown):
            pattern.upload(self._board, steps)
            self._shown = steps.copy()
            self.uploads += 1
        parts = []
        for first in range(0, ticks, self.burst):
            parts.append(self._take(min(self.burst, ticks - first)))
        planes = np.concatenate(parts)
        self.wrong_bits += int((planes != self._expected(steps, ticks)).sum())
        return planes

    def _take(self, frames: int) -> Planes:
        board, first = self._board, self._stepper.frames
        board.write("capture_arm", frames)
        self._stepper.step(frames)
        for _ in range(_POLLS):
            if board.read_twice("capture_state") & _DONE:
                break
        else:
            raise LineFault(Cause.LATE, f"the burst of {frames} frames did not end")
        taken = capture.drain(board, frames)
        if taken.lost or taken.frames.tolist() != list(range(first, first + frames)):
            raise LineFault(
                Cause.LATE, f"frames {first} to {first + frames - 1} did not come whole"
            )
        self.bytes += taken.bytes
        return taken.planes

    def _expected(self, steps: npt.NDArray[np.uint8], ticks: int) -> Planes:
        from rtl_model.cycle import Settings, planes

        settings = Settings(threshold=self._level, reset_rule=self._reset)
        return planes(self._info.geometry, settings, steps, ticks, self._charge)


def _set_up(board: Board, info: BoardInfo, level: int, reset: int) -> None:
    for name, value in (
        ("sensor_run", 0),
        ("sensor_pattern", 0),
        ("sensor_threshold", level),
        ("sensor_reset_rule", reset),
        ("sensor_rows", info.rows - 1 << 16),
        ("sensor_columns", info.columns - 1 << 16),
        ("capture_source", 0),
    ):
        board.write(name, value)
