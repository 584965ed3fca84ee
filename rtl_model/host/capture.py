"""A burst of frames: armed, awaited, drained by FIFO reads, every row checked.

Reading the FIFO moves it on, so nothing is ever read again blindly: after a fault the board's own
pointer is read, set back to the first word that is not verified, and read again. A row counts when
its CRC-32, its sequence number, its frame and its place are right.
"""

from __future__ import annotations

import zlib
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from cosim import InputError
from rtl_model.host.board import Board, BoardInfo
from rtl_model.host.faults import Cause, LineFault
from rtl_model.registers import mask

__all__ = ["SETTINGS", "Captured", "burst", "drain"]

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
"""Registers that a burst depends on; read before and after it."""

_ARMED, _DONE = (mask("capture_state", name) for name in ("armed", "done"))
_STALLS = 8  # faults in a row without one more verified row, before it is given up
_FRAME_BITS = 20
_MARGIN = 3  # wait for so many times what the burst should take


class Captured(NamedTuple):
    """A burst. Only rows that were verified are in it.

    planes: (frames, rows, columns) bool, the frames all of whose rows are there; outside the
        window nothing fires. frames: (n,) their numbers since the clear, modulo 2^20.
    sequence: (rows,) numbers of all verified rows. lost: rows the board had no memory for.
    retries: times the pointer was set back. bytes: of the records drained; seconds: that took.
    settings: the registers `SETTINGS` during the burst.
    """

    planes: npt.NDArray[np.bool_]
    sequence: npt.NDArray[np.uint32]
    frames: npt.NDArray[np.uint32]
    lost: int
    retries: int
    bytes: int
    seconds: float
    settings: dict[str, int]


def burst(board: Board, frames: int, *, clear: bool = False) -> Captured:
    """Takes `frames` frames. A sensor that stands still is run for it and stopped after.

    clear: the burst begins with frame 0 and no charge (the sensor is stopped for it).
    InputError for a burst that does not fit; LineFault where it cannot be had verified.
    """
    info = board.info()
    settings = {name: board.read_twice(name) for name in SETTINGS}
    rows = _Rows(info, settings)
    _check_size(info, rows, frames)
    ran = board.read_twice("sensor_run")
    if clear and ran:
        board.write("sensor_run", 0)
        _await_stop(board, info, settings)
    if clear:
        board.write("sensor_clear", 1)
    board.write("capture_arm", 0)  # whatever was there is gone, and a lost arm can be told
    board.write("capture_arm", frames)
    if clear or not ran:
        board.write("sensor_run", 1)
    try:
        _await(board, info, settings, frames)
    finally:
        if not ran:
            board.write("sensor_run", 0)
    return _drained(board, rows, frames, settings)


def drain(board: Board, frames: int) -> Captured:
    """Returns a burst of `frames` frames that is over and stands whole in the board's memory, for
    those who arm it and run the sensor themselves. LineFault where it cannot be had verified."""
    info = board.info()
    settings = {name: board.read_twice(name) for name in SETTINGS}
    return _drained(board, _Rows(info, settings), frames, settings)


def _drained(board: Board, rows: _Rows, frames: int, settings: dict[str, int]) -> Captured:
    begun = board.bone.port.now()
    stored, lost = board.read_twice("capture_rows"), board.read_twice("capture_lost")
    if stored + lost != frames * rows.count:
        raise LineFault(
            Cause.LATE,
            f"the burst has {stored} rows and {lost} lost ones, not {frames * rows.count}",
        )
    drained = _Drain(board, rows, stored)
    drained.run()
    for name, value in settings.items():
        if board.read_twice(name) != value:
            raise LineFault(Cause.MISPLACED, f"{name} changed while the burst was taken")
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
    """Rows of a window as records."""

    def __init__(self, info: BoardInfo, settings: dict[str, int]) -> None:
        self.info = info
        rows, columns = settings["sensor_rows"], settings["sensor_columns"]
        last = min(rows >> 16, info.rows - 1)
        self.first, self.count = rows & 0xFFFF, max(0, last - (rows & 0xFFFF) + 1)
        if settings["capture_source"] == 1:  # the sink shows all rows
            self.first, self.count = 0, info.rows
            columns = (info.columns - 1) << 16
        self.columns = slice(columns & 0xFFFF, (columns >> 16) + 1)
        self.words = info.geometry.record_words

    def check(self, sequence: int, data: bytes, first: int | None) -> int | None:
        """Returns the frame number of a record that is what record `sequence` of the burst must
        be, else None. first: number of the burst's first frame, None where not known yet."""
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
        """Returns the whole frames of verified records, and their numbers."""
        whole = len(records) // self.count
        used = records[: whole * self.count]
        words = np.frombuffer(b"".join(used), ">u4").reshape(whole, self.count, self.words)
        bits = words[:, :, 2:-1].astype("<u4").view(np.uint8)
        spikes = np.unpackbits(bits, axis=2, bitorder="little")[:, :, : self.info.columns]
        planes = np.zeros((whole, self.info.rows, self.info.columns), bool)
        planes[:, self.first : self.first + self.count] = spikes.astype(bool)
        return planes, (words[:, 0, 1] >> 12).astype(np.uint32)


class _Drain:
    """Empties the capture memory, record by record."""

    def __init__(self, board: Board, rows: _Rows, stored: int) -> None:
        self.board, self.rows, self.stored = board, rows, stored
        self.verified: list[bytes] = []
        self.retries = 0
        self._first: int | None = None
        self._tail = b""  # of a record that is not complete yet

    def run(self) -> None:
        """Reads until all records are verified, or LineFault."""
        bone = self.board.bone
        place = self.board.csr.register("capture_data").address
        stalls = 0
        self._seek(0)
        while len(self.verified) < self.stored:
            left = (self.stored - len(self.verified)) * self.rows.words - len(self._tail) // 4
            had = len(self.verified)
            try:
                values = bone.read(place, min(left, bone.words_at_once), fixed=True)
                fault = self._take(b"".join(value.to_bytes(4, "big") for value in values))
            except LineFault as exc:
                if exc.cause in (Cause.GONE, Cause.ECHO, Cause.DIFFERS):
                    raise
                fault = exc
            stalls = 0 if len(self.verified) > had else stalls
            if fault is None:
                continue
            stalls += 1
            self.retries += 1
            if stalls > _STALLS:
                raise fault
            bone.resynchronise()
            self._seek(len(self.verified) * self.rows.words)

    def _take(self, data: bytes) -> LineFault | None:
        """Verifies what records are complete; returns what is wrong with the first that is not
        right."""
        self._tail += data
        size = 4 * self.rows.words
        while len(self._tail) >= size:
            record, self._tail = self._tail[:size], self._tail[size:]
            number = len(self.verified)
            frame = self.rows.check(number, record, self._first)
            if frame is None:
                return LineFault(
                    Cause.GARBLED, f"row {number} of the burst came with a wrong CRC or number"
                )
            if self._first is None:
                self._first = frame
            self.verified.append(record)
        return None

    def _seek(self, word: int) -> None:
        """Makes sure that the next word read is `word`: asks where the board is, and sets it back
        only where it is elsewhere."""
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


def _check_size(info: BoardInfo, rows: _Rows, frames: int) -> None:
    if rows.count == 0:
        raise InputError("the window", "at least one row", "empty", "write sensor_rows")
    if not 1 <= frames < 1 << 32:
        raise InputError("the frames of a burst", "1 to 4294967295", str(frames), "give fewer")
    fit = info.capture_words // (rows.words * rows.count)
    if frames > fit:
        raise InputError(
            "the frames of a burst",
            f"at most {fit} of {rows.count} rows, for which the board has memory",
            str(frames),
            "take fewer frames or a smaller window" if fit else "take a smaller window",
        )


def _frame_s(board: Board, info: BoardInfo, settings: dict[str, int]) -> float:
    """Returns how long a frame takes here."""
    clocks = max(settings["sensor_tick_clocks"], board.read_twice("sensor_tick_minimum"))
    period = clocks << settings["sensor_clock_select"]
    return period / info.clock_hz * board.bone.time_scale


def _await(board: Board, info: BoardInfo, settings: dict[str, int], frames: int) -> None:
    frame_s = _frame_s(board, info, settings)
    port = board.bone.port
    end = port.now() + _MARGIN * (frames + 2) * frame_s + 4 * board.bone.patience_s
    board.bone.pause((frames + 1) * frame_s)
    while True:
        now = port.now()
        state = board.read_twice("capture_state") if now > end else board.read("capture_state")
        if state & _DONE and board.read_twice("capture_state") & _DONE:
            return
        if now > end:
            what = "never began" if state & _ARMED else "did not end"
            raise LineFault(Cause.LATE, f"the burst of {frames} frames {what}")
        board.bone.pause(frame_s)


def _await_stop(board: Board, info: BoardInfo, settings: dict[str, int]) -> None:
    """The frame under way is finished before the sensor stands still."""
    board.bone.pause(2 * _frame_s(board, info, settings))
