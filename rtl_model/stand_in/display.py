"""A board as display. Planes are sent to its sink and displayed tick by tick.

The CRC-32 of the displayed planes is compared. Optionally the planes are captured and read back.
"""

from __future__ import annotations

import zlib
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from cosim import InputError
from rtl_model.host import Cause, LineFault, capture
from rtl_model.registers import mask
from rtl_model.stand_in.opening import OpenBoard, Stepper

_DONE: Final = mask("capture_state", "done")
_RUNNING: Final = mask("sink_state", "running")
_POLLS: Final = 200

Planes = npt.NDArray[np.bool_]


class DisplayCheck(NamedTuple):
    """Result of a check of displayed planes.

    Attributes:
        planes: number of planes.
        wrong_crc: whether the CRC-32 of the displayed planes differs.
        wrong_bits: wrong bits in the planes that were read back, 0 if none were.
    """

    planes: int
    wrong_crc: bool
    wrong_bits: int


class BoardDisplay:
    """An open board with an empty sink.

    Raises InputError if its memories do not hold a plane.

    Args:
        opened: the board.
        back: whether the displayed planes are captured and read back.

    Attributes:
        bytes: size of the planes sent so far.
        burst: number of planes sent at once.
    """

    def __init__(self, opened: OpenBoard, *, back: bool = False) -> None:
        self._board, self._info, self._back = opened.board, opened.info, back
        info = opened.info
        size = info.geometry
        self._wide = 32 * size.row_words
        words, record = size.row_words * size.rows, size.record_words * size.rows
        sizes = [("sink", "SINK_WORDS", info.sink_words, words)]
        if back:
            sizes.append(("capture", "CAPTURE_WORDS", info.capture_words, record))
        for what, parameter, size_words, need in sizes:
            if size_words < need:
                raise InputError(
                    opened.name, f"one whose {what} memory holds a plane, {need} words",
                    f"one of {size_words} words", f"build it with a larger {parameter}",
                )  # fmt: skip
        self.burst = min(size // need for _, _, size, need in sizes)
        self.bytes = self._crc = 0
        self._stepper = Stepper(self._board, info)
        self._board.write("capture_source", int(back))
        self._stepper.restart()
        self._board.write("sink_clear", 1)

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of a plane."""
        return self._info.rows, self._info.columns

    def show(self, planes: Planes) -> DisplayCheck:
        """Displays planes, (n, rows, columns) bool, one in each tick.

        Raises LineFault if the sink was empty or full, or did not display all of them.
        """
        wrong_crc, wrong_bits = False, 0
        for first in range(0, len(planes), self.burst):
            part = planes[first : first + self.burst]
            crc, bits = self._show(part)
            wrong_crc |= crc
            wrong_bits += bits
        return DisplayCheck(len(planes), wrong_crc, wrong_bits)

    def _show(self, planes: Planes) -> tuple[bool, int]:
        board, count = self._board, len(planes)
        padded = np.zeros((count, self._info.rows, self._wide), bool)
        padded[..., : self._info.columns] = planes
        words = np.packbits(padded, axis=2, bitorder="little").view("<u4").ravel()
        if self._back:
            board.write("capture_arm", count)
        rows = board.read_twice("sink_rows")
        address, size = board.csr.register("sink_data").address, board.bone.words_at_once
        for n in range(0, len(words), size):
            board.verified_write(address, words[n : n + size].tolist(), fixed=True)
        board.write("sink_run", count)
        self._stepper.step(count)
        self._wait("sink_state", _RUNNING, 0)
        wrong = [name for name in ("underruns", "lost") if board.read_twice(f"sink_{name}")]
        displayed = board.read_twice("sink_rows") - rows & 0xFFFFFFFF
        if wrong or displayed != count * self._info.rows:
            raise LineFault(
                Cause.LATE,
                f"the sink displayed {displayed} of {count * self._info.rows} rows"
                + "".join(f", words counted in sink_{name}" for name in wrong),
            )
        self.bytes += 4 * len(words)
        self._crc = zlib.crc32(words.astype(">u4").tobytes(), self._crc)
        crc = board.read_twice("sink_crc")
        if not self._back:
            return crc != self._crc, 0
        self._wait("capture_state", _DONE, _DONE)
        back = capture.drain(board, count)
        return crc != self._crc, int((back.planes != planes).sum())

    def _wait(self, name: str, mask: int, value: int) -> None:
        for _ in range(_POLLS):
            if self._board.read_twice(name) & mask == value:
                return
        raise LineFault(Cause.LATE, f"{name} does not report the end of the planes")
