"""Capture of a burst of frames: arm, wait, drain the FIFO, verify every row.

A read of the FIFO advances its pointer. After a fault the pointer is therefore read, set back to
the first unverified word, and the words are read again. Over UDP, where a request may arrive twice,
the memory is read by address instead (`capture_mem`), which nothing disturbs. A row is verified if
its CRC-32, sequence number, frame number and row number are right.
"""

from __future__ import annotations

import zlib
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from cosim import InputError
from rtl_model.host.board import Board, BoardInfo
from rtl_model.host.countdown import Countdown
from rtl_model.host.faults import Cause, LineFault
from rtl_model.registers import mask

SETTINGS = (
    "sensor_threshold",
    "sensor_clock_select",
    "sensor_reset_rule",
    "sensor_rows",
    "sensor_columns",
    "sensor_tick_clocks",
    "sensor_pattern",
    "sensor_level",
    "capture_source",
)
"""Registers that determine a burst, read before and after it."""

_ARMED, _DONE = (mask("capture_state", name) for name in ("armed", "done"))
_STALLS = 8  # consecutive faults without a newly verified row before a fault is raised
_FRAME_BITS = 20
_MARGIN = 3  # ratio of the longest wait to the burst's nominal duration


class Captured(NamedTuple):
    """A burst of verified rows.

    Attributes:
        planes: complete frames, (n, rows, columns) bool; False outside the window.
        sequence: numbers of all verified rows, (r,) uint32.
        frames: numbers of the complete frames since the clear, modulo 2^20, (n,) uint32.
        lost: rows that did not fit in the board's memory.
        retries: how often the pointer was set back.
        bytes: size of the drained records.
        seconds: duration of the draining, s.
        settings: registers `SETTINGS` during the burst.
    """

    planes: npt.NDArray[np.bool_]
    sequence: npt.NDArray[np.uint32]
    frames: npt.NDArray[np.uint32]
    lost: int
    retries: int
    bytes: int
    seconds: float
    settings: dict[str, int]


def burst(board: Board, frames: int, *, clear: bool = False, reading: int = 0) -> Captured:
    """Captures a burst. A stopped sensor is started for it and stopped afterwards.

    Args:
        board: a Viform board.
        frames: number of frames.
        clear: whether the burst begins with frame 0 and without charge. A running sensor is stopped
            first.
        reading: value of `sensor_reading`, for a burst of its passes by a stopped sensor; 0 for
            frames.

    Raises:
        InputError: for a burst that does not fit in the board's memory.
        LineFault: if the rows cannot be verified.
    """
    info = board.info()
    settings = {name: board.read_twice(name) for name in SETTINGS}
    rows = _Rows(info, settings)
    _check_size(info, rows, frames, reading > 0)
    ran = board.read_twice("sensor_run")
    if clear and ran:
        stop(board, info, settings)
    if clear:
        board.write("sensor_clear", 1)
    board.write("capture_arm", 0)  # empties the memory, so that a lost write is detected
    board.write("capture_arm", frames)
    if reading:
        board.write("sensor_reading", reading)
    elif clear or not ran:
        board.write("sensor_run", 1)
    try:
        _await(board, info, settings, frames)
    finally:
        if not ran:
            board.write("sensor_run", 0)
    return _drained(board, rows, frames, settings)


def drain(board: Board, frames: int) -> Captured:
    """Reads a burst of `frames` frames that is complete in the board's memory.

    It is for callers that arm the burst and run the sensor themselves. Raises LineFault if the rows
    cannot be verified.
    """
    info = board.info()
    settings = {name: board.read_twice(name) for name in SETTINGS}
    return _drained(board, _Rows(info, settings), frames, settings)


def _drained(board: Board, rows: _Rows, frames: int, settings: dict[str, int]) -> Captured:
    begun = board.bone.port.now()
    stored, lost = board.read_twice("capture_rows"), board.read_twice("capture_lost")
    if stored + lost != frames * rows.count:
        raise LineFault(
            Cause.LATE,
            f"the burst has {stored} stored and {lost} lost rows, not {frames * rows.count} in all",
        )
    drained = _Drain(board, rows, stored)
    if board.bone.confirms:
        drained.run_by_address()
    else:
        drained.run()
    for name, value in settings.items():
        if board.read_twice(name) != value:
            raise LineFault(Cause.MISPLACED, f"{name} changed during the burst")
    planes, numbers = rows.planes(drained.verified)
    return Captured(
        planes=planes,
        sequence=np.arange(len(drained.verified), dtype=np.uint32),
        frames=numbers,
        lost=lost,
        retries=drained.retries,
        bytes=4 * rows.words * stored,
        seconds=board.bone.port.now() - begun,
        settings=settings,
    )


class _Rows:
    """The records of a window's rows."""

    def __init__(self, info: BoardInfo, settings: dict[str, int]) -> None:
        self.info = info
        rows, columns = settings["sensor_rows"], settings["sensor_columns"]
        last = min(rows >> 16, info.rows - 1)
        self.first, self.count = rows & 0xFFFF, max(0, last - (rows & 0xFFFF) + 1)
        if settings["capture_source"] == 1:  # the sink displays all rows
            self.first, self.count = 0, info.rows
            columns = (info.columns - 1) << 16
        self.columns = slice(columns & 0xFFFF, (columns >> 16) + 1)
        self.words = info.geometry.record_words

    def check(self, sequence: int, data: bytes, first: int | None) -> int | None:
        """Verifies a record; returns its frame number, or None if it is wrong.

        Args:
            sequence: number of the record in the burst.
            data: the record.
            first: number of the burst's first frame, None if unknown.
        """
        body, crc = data[:-4], int.from_bytes(data[-4:], "big")
        if zlib.crc32(body) != crc or int.from_bytes(body[:4], "big") != sequence:
            return None
        place = int.from_bytes(body[4:8], "big")
        turn, row = divmod(sequence, self.count)
        frame = place >> 12
        if place & 0xFFF != self.first + row:
            return None
        if first is not None and frame != (first + turn) % (1 << _FRAME_BITS):
            return None
        return frame

    def planes(self, records: list[bytes]) -> tuple[npt.NDArray[np.bool_], npt.NDArray[np.uint32]]:
        """The complete frames of verified records, and their numbers."""
        frames = len(records) // self.count
        used = records[: frames * self.count]
        words = np.frombuffer(b"".join(used), ">u4").reshape(frames, self.count, self.words)
        bits = words[:, :, 2:-1].astype("<u4").view(np.uint8)
        spikes = np.unpackbits(bits, axis=2, bitorder="little")[:, :, : self.info.columns]
        planes = np.zeros((frames, self.info.rows, self.info.columns), bool)
        planes[:, self.first : self.first + self.count] = spikes.astype(bool)
        return planes, (words[:, 0, 1] >> 12).astype(np.uint32)


class _Drain:
    """Drains the capture memory record by record."""

    def __init__(self, board: Board, rows: _Rows, stored: int) -> None:
        self.board, self.rows, self.stored = board, rows, stored
        self.verified: list[bytes] = []
        self.retries = 0
        self._first: int | None = None
        self._tail = b""  # incomplete record

    def run(self) -> None:
        """Reads until all records are verified. Raises LineFault if that fails."""
        bone = self.board.bone
        place = self.board.csr.register("capture_data").address
        stalls = 0
        self._seek(0)
        while len(self.verified) < self.stored:
            left = (self.stored - len(self.verified)) * self.rows.words - len(self._tail) // 4
            before = len(self.verified)
            try:
                values = bone.read(place, min(left, bone.words_at_once), fixed=True)
                fault = self._take(b"".join(value.to_bytes(4, "big") for value in values))
            except LineFault as exc:
                if exc.cause in (Cause.GONE, Cause.ECHO, Cause.DIFFERS):
                    raise
                fault = exc
            stalls = 0 if len(self.verified) > before else stalls
            if fault is None:
                continue
            stalls += 1
            self.retries += 1
            if stalls > _STALLS:
                raise fault
            bone.resynchronise()
            self._seek(len(self.verified) * self.rows.words)

    def run_by_address(self) -> None:
        """Reads all records by address. Raises LineFault if one is wrong."""
        base, size = self.board.csr.base("capture_mem"), 4 * self.rows.words
        while True:
            first = len(self.verified)
            words = self.board.bone.read(base + size * first, (self.stored - first) * size // 4)
            self._tail = b""
            fault = self._take(np.array(words, ">u4").tobytes())
            if fault is None:
                return
            self.retries += 1
            if self.retries > _STALLS:
                raise fault

    def _take(self, data: bytes) -> LineFault | None:
        """Verifies the complete records; returns the fault of the first wrong one, if any."""
        self._tail += data
        size = 4 * self.rows.words
        while len(self._tail) >= size:
            record, self._tail = self._tail[:size], self._tail[size:]
            number = len(self.verified)
            frame = self.rows.check(number, record, self._first)
            if frame is None:
                return LineFault(
                    Cause.GARBLED, f"row {number} of the burst has a wrong CRC or number"
                )
            if self._first is None:
                self._first = frame
            self.verified.append(record)
        return None

    def _seek(self, word: int) -> None:
        """Sets the board's read pointer to `word`, unless it already is there."""
        self._tail = b""
        board = self.board
        for _ in range(_STALLS):
            if board.read_twice("capture_pointer") == word:
                return
            try:
                board.write("capture_pointer", word)
            except LineFault as fault:
                if fault.cause not in (Cause.SHORT, Cause.GARBLED):
                    raise
        raise LineFault(Cause.MISPLACED, f"the board's read pointer cannot be set to {word}")


def _check_size(info: BoardInfo, rows: _Rows, frames: int, reading: bool) -> None:
    if rows.count == 0:
        raise InputError("the window", "at least one row", "empty", "write sensor_rows")
    if not 1 <= frames < 1 << 32:
        raise InputError("the frames of a burst", "1 to 4294967295", str(frames), "give fewer")
    fit = info.capture_words // (rows.words * rows.count)
    if frames > fit and reading:
        raise InputError(
            "the levels of a reading",
            f"at most {1 << (fit + 1).bit_length() - 1} with a window of {rows.count} rows, "
            f"of which the board's memory holds {fit} passes",
            str(frames + 1),
            "take fewer levels or a smaller window",
        )
    if frames > fit:
        raise InputError(
            "the frames of a burst",
            f"at most {fit} of {rows.count} rows, for which the board has memory",
            str(frames),
            "take fewer frames or a smaller window" if fit else "take a smaller window",
        )


def _frame_s(board: Board, info: BoardInfo, settings: dict[str, int]) -> float:
    """Duration of a frame in the host's time, s."""
    clocks = max(settings["sensor_tick_clocks"], board.read_twice("sensor_tick_minimum"))
    period = clocks << settings["sensor_clock_select"]
    return period / info.clock_hz * board.bone.time_scale


def _await(board: Board, info: BoardInfo, settings: dict[str, int], frames: int) -> None:
    frame_s = _frame_s(board, info, settings)
    most = _MARGIN * (frames + 2) * frame_s + 4 * board.bone.patience_s
    board.bone.pause((frames + 1) * frame_s)
    limit = Countdown(most, most / 10, board.bone.port.now)
    while True:
        over = limit.left() <= 0
        state = board.read_twice("capture_state") if over else board.read("capture_state")
        if state & _DONE and board.read_twice("capture_state") & _DONE:
            return
        if over:
            what = "did not begin" if state & _ARMED else "did not end"
            raise LineFault(Cause.LATE, f"the burst of {frames} frames {what}")
        board.bone.pause(frame_s)


def stop(board: Board, info: BoardInfo, settings: dict[str, int]) -> None:
    """Stops the sensor and waits until it has finished the frame in progress."""
    board.write("sensor_run", 0)
    board.bone.pause(2 * _frame_s(board, info, settings))
