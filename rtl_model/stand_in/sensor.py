"""A board as sensor: it takes the electrons of each tick and returns spike planes.

A pixel of the board receives an integer number of electrons, 0 to 255, in each tick and fires at
255 + 256 k of them. The scene's light is scaled such that the spike rate (light divided by
threshold) is the same. Rounding changes the rate by at most half an electron divided by the
threshold, so k is the largest level at which the brightest light still fits in 255 electrons.

The cycle model is imported in the function that needs it, because it imports numba.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
import numpy.typing as npt

from cosim import InputError
from rtl_model.host import Board, BoardInfo, Cause, LineFault, capture, pattern
from rtl_model.registers import mask, quantum
from rtl_model.stand_in.opening import OpenBoard, Stepper

LEVELS: Final = 16
STEP_MOST: Final = 255
FRAMES_MOST: Final = 1 << 20
"""Most frames of a run, because the frame number of a captured row has 20 bits."""
RESETS: Final = {"residual": 0, "hard": 1, "subtract": 2}
_DONE: Final = mask("capture_state", "done")
_POLLS: Final = 200

Planes = npt.NDArray[np.bool_]


def finest_level(rate: float) -> int:
    """The highest threshold level that the light allows, which has the smallest rounding error.

    Args:
        rate: highest rate of the scene, spikes per tick.
    """
    fits = [k for k in range(LEVELS) if rate * quantum(k) <= STEP_MOST]
    return max(fits, default=0)


def written_levels(rate: float, ratios: Sequence[float]) -> list[int] | None:
    """Levels for the thresholds of a run, the finest that the light allows; None for none.

    Level k fires at 256 (k + 1) - 1 electrons. So the levels are chosen such that the k + 1 have
    the exact ratios, and a threshold is off by at most 1 / 256 (k + 1) of itself.

    Args:
        rate: highest rate of the scene at the first threshold, spikes per tick.
        ratios: each threshold over the first.
    """
    for first in range(LEVELS - 1, -1, -1):
        levels = [(first + 1) * ratio - 1 for ratio in ratios]
        whole = all(abs(k - round(k)) < 1e-9 and 0 <= round(k) < LEVELS for k in levels)
        if whole and rate * quantum(first) <= STEP_MOST:
            return [round(k) for k in levels]
    return None


def quantise(
    rate: npt.NDArray[np.float64], level: int
) -> tuple[npt.NDArray[np.uint8], npt.NDArray[np.float64]]:
    """Rounds spike rates to integer electrons in a tick.

    Rates are limited to 1, because a pixel fires at most once in a tick.

    Args:
        rate: spikes per tick, float64.
        level: level of the threshold.

    Returns:
        Electrons in a tick, uint8, and the error of the rate, spikes per tick. Both have the shape
        of `rate`.
    """
    exact = np.minimum(rate, 1.0)
    steps = np.minimum(np.rint(exact * quantum(level)), STEP_MOST)
    return steps.astype(np.uint8), steps / quantum(level) - exact


class BoardSensor:
    """An open board, which is stopped, without charge, and reads all its pixels.

    Args:
        opened: the board.
        level: level of the threshold.
        reset: reset rule, a key of `RESETS`.
        frames: number of frames of the run.

    Attributes:
        bytes: size of the captured records so far.
        wrong_bits: bits that differ from the cycle model so far.
        burst: number of frames captured at once.

    Raises:
        InputError: if the memory does not hold a frame, or if the frames are too many to number.
    """

    def __init__(self, opened: OpenBoard, level: int, reset: str, frames: int) -> None:
        self._board, self._info = opened.board, opened.info
        info, size = opened.info, opened.info.geometry
        need = size.record_words * size.rows
        self.burst = info.capture_words // need
        if self.burst < 1:
            raise InputError(
                opened.name, f"one whose capture memory holds a frame, {need} words",
                f"one of {info.capture_words} words", "build it with a larger CAPTURE_WORDS",
            )  # fmt: skip
        if frames > FRAMES_MOST:
            raise InputError(
                "duration", f"at most {FRAMES_MOST} cycles, which {opened.name} can number",
                f"{frames} cycles", "shorten it",
            )  # fmt: skip
        self.bytes = self.wrong_bits = 0
        self._level, self._reset = level, RESETS[reset]
        self._stepper = Stepper(self._board, info)
        self._uploaded: npt.NDArray[np.uint8] | None = None
        self._charge = np.zeros((info.rows, info.columns), np.int64)
        self._rows = (0, info.rows - 1)
        _set_up(self._board, info, level, self._reset)
        self._stepper.restart()

    def write(self, level: int, rows: tuple[int, int]) -> None:
        """Writes threshold and window of the stopped board; both hold from the next tick on.

        Args:
            level: level of the threshold.
            rows: (first, stop) rows that are read.
        """
        self._level, self._rows = level, (rows[0], rows[1] - 1)
        self._board.write("sensor_threshold", level)
        self._board.write("sensor_rows", self._rows[1] << 16 | self._rows[0])

    def expose(self, steps: npt.NDArray[np.uint8], ticks: int) -> Planes:
        """Spikes of the next ticks, (ticks, rows, columns) bool.

        Args:
            steps: electrons in each tick, (rows, columns) uint8.
            ticks: number of ticks.
        """
        if self._uploaded is None or not np.array_equal(steps, self._uploaded):
            pattern.upload(self._board, steps)
            self._uploaded = steps.copy()
        parts = []
        for first in range(0, ticks, self.burst):
            parts.append(self._capture(min(self.burst, ticks - first)))
        planes = np.concatenate(parts)
        self.wrong_bits += int((planes != self._expected(steps, ticks)).sum())
        return planes

    def _capture(self, frames: int) -> Planes:
        board, first = self._board, self._stepper.frames
        board.write("capture_arm", frames)
        self._stepper.step(frames)
        for _ in range(_POLLS):
            if board.read_twice("capture_state") & _DONE:
                break
        else:
            raise LineFault(Cause.LATE, f"the burst of {frames} frames did not end")
        captured = capture.drain(board, frames)
        if captured.lost or captured.frames.tolist() != list(range(first, first + frames)):
            raise LineFault(Cause.LATE, f"frames {first} to {first + frames - 1} are incomplete")
        self.bytes += captured.bytes
        return captured.planes

    def _expected(self, steps: npt.NDArray[np.uint8], ticks: int) -> Planes:
        from rtl_model.cycle import Settings, planes

        settings = Settings(threshold=self._level, reset_rule=self._reset, rows=self._rows)
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
