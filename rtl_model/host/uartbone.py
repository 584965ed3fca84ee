"""LiteX's uartbone from the host's side: words at byte addresses, over any port.

The wire has no acknowledgement, no CRC and no status; the board forgets a transaction 100 ms after
its first byte (litex/soc/cores/uart.py). So a transaction is kept under 50 ms of line time, an
answer is read to its exact length with one request outstanding, and after any fault the line is
kept silent until the board has forgotten. What a plain read returns can be wrong without a sign
(one flipped bit): `read_twice`, the counters of writes (`Board.write`) and the CRC of captured rows
are there for that.
"""

from __future__ import annotations

import re
import zlib
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from cosim import InputError
from rtl_model.host.faults import Cause, LineFault
from rtl_model.host.ports import Port

if TYPE_CHECKING:
    from rtl_model.host.log import Recorder

__all__ = ["BAUD_MIN", "FINAL", "PATIENCE_S", "SIMULATED_PATIENCE_S", "Uartbone"]

PATIENCE_S, SIMULATED_PATIENCE_S = 0.3, 3.0
"""For an answer, beyond line time. A simulated board on a busy machine may be late: its thread does
not run for long, and no line is to blame for that."""

_WRITE, _READ, _WRITE_FIXED, _READ_FIXED = 1, 2, 3, 4
_HEADER = 6  # bytes: command, length, word address
_BITS = 10  # of a byte on the line, 8N1
_WORDS = 255  # of a transaction; length 0 would be 256
_TRANSACTION_S = 0.05  # half of the board's watchdog
_FORGOTTEN_S = 0.11  # silence after which a board has dropped a transaction
_CHATTER = 20  # silences waited for before a line is said never to be silent
_GULP = 1 << 16  # bytes; more than any answer, so that a read of them waits for silence
_TAIL = 2  # bytes' time that the line must be silent after an answer; a board slower than life is
# not waited for: what it sends later counts as strays before the next request
_TEXT = re.compile(rb"[ -~\t\r\n]+")
_MORE_TEXT = 4  # bytes beyond an answer, from which on printable ones are taken for text
_SLACK = 1.25  # of line time: stop bits, gaps, a clock that is off

FINAL = (Cause.GONE, Cause.STUCK, Cause.ECHO, Cause.DIFFERS)
"""Causes that asking again mends none of, nor another baud."""

BAUD_MIN = int((_HEADER + 4) * _BITS / _TRANSACTION_S) + 1
"""Slowest line on which one word still fits the time."""


class Uartbone:
    """Master of a bus behind a port.

    baud: of the line; None is the port's.
    time_scale: seconds that a second of the board's clock takes here; more than 1 for a simulated
        board that is slower than life.
    patience_s: beyond line time, for the adapter's buffers and the system.
    retries: of a read without effect, each after a silence. Writes and reads of a FIFO are never
        sent twice.
    log: takes every byte both ways.

    Attributes:
        bytes_sent, bytes_read, strays, dropped: to the board; of answers; that came unasked; thrown
            away while the line was brought to silence. The last three are all that ever came.
        bytes_asked: that answers had to have, those that failed included.
        words_written, written_crc: words sent to be written, and the CRC-32 of them, which goes on
            from whatever it is set to.
        on_other_answer: told (address, words that came, words that are right) of an answer that was
            of the right length and wrong, as far as `read_twice` finds one.
    """

    def __init__(
        self,
        port: Port,
        *,
        baud: int | None = None,
        time_scale: float = 1.0,
        patience_s: float = PATIENCE_S,
        retries: int = 2,
        log: Recorder | None = None,
    ) -> None:
        self.port, self.time_scale = port, time_scale
        self.patience_s, self.retries, self.log = patience_s, retries, log
        self.baud = port.baud if baud is None else baud
        if self.baud < BAUD_MIN:
            raise InputError(
                "the baud",
                f"at least {BAUD_MIN}, for the board drops a transaction after 100 ms",
                str(self.baud),
                "give another --baud",
            )
        if not time_scale > 0:
            raise InputError("the time scale", "above 0", str(time_scale), "give another")
        self._owed = 0  # bytes sent since the last answer: they may still be in a buffer
        self.bytes_sent = self.bytes_read = self.bytes_asked = self.dropped = 0
        self.retried = self.strays = self.round_trips = 0
        self.words_written = self.written_crc = 0
        self.on_other_answer: Callable[[int, list[int], list[int]], None] | None = None

    @property
    def bytes_heard(self) -> int:
        """All bytes that came from the board's side, wanted or not."""
        return self.bytes_read + self.strays + self.dropped

    @property
    def words_at_once(self) -> int:
        """Words of one transaction: under 50 ms of line time, at most 255."""
        bytes_at_once = _TRANSACTION_S * self.baud / _BITS
        return max(1, min(_WORDS, int((bytes_at_once - _HEADER - 1e-9) // 4)))

    def read(
        self, address: int, words: int = 1, *, fixed: bool = False, retry: bool | None = None
    ) -> list[int]:
        """Returns `words` words from a byte address on, or all from that one where `fixed`.

        retry: whether reading twice is harmless; None: where not `fixed`. LineFault SILENT, SHORT,
        GARBLED or ECHO; the line is then silent and the board ready for a command.
        """
        _check_address(address, 1 if fixed else words)
        again = self.retries if (not fixed if retry is None else retry) else 0
        values: list[int] = []
        while len(values) < words:
            count = min(words - len(values), self.words_at_once)
            place = address if fixed else address + 4 * len(values)
            data = self._ask(place, count, fixed, again)
            values += [int.from_bytes(data[n : n + 4], "big") for n in range(0, len(data), 4)]
        return values

    def read_twice(self, address: int, words: int = 1) -> list[int]:
        """Returns words that stand still, read until two readings in a row are the same: that a
        flipped, lost or added byte goes unnoticed takes the same error twice.

        LineFault GARBLED where they never are.
        """
        before: list[int] | None = None
        others: list[list[int]] = []
        fault: LineFault | None = None
        for _ in range(2 * self.retries + 2):
            try:
                now = self.read(address, words, retry=False)
            except LineFault as exc:
                if exc.cause in FINAL:
                    raise
                fault, before = exc, None
                self.retried += 1
                continue
            if now == before:
                for other in others:
                    if other != now:
                        self.other_answer(address, other, now, counted=True)
                return now
            others.append(now)
            if before is not None:
                self.resynchronise()
                self.retried += 1
            fault, before = None, now
        if fault is not None:
            raise fault
        raise LineFault(
            Cause.GARBLED, f"two readings of {address:#x} that must be the same never were"
        )

    def other_answer(
        self, address: int, got: list[int], right: list[int], *, counted: bool = False
    ) -> None:
        """An answer was of the right length and wrong: it counts as repeated, unless it is
        `counted` already, and `on_other_answer` is told."""
        self.retried += not counted
        if self.on_other_answer is not None:
            self.on_other_answer(address, got, right)

    def write(self, address: int, values: Sequence[int] | int, *, fixed: bool = False) -> None:
        """Writes words from a byte address on, or all to that one where `fixed`. Nothing says
        whether they arrive; what was sent in part is never sent again. LineFault STUCK or GONE."""
        values = [values] if isinstance(values, int) else list(values)
        _check_address(address, 1 if fixed else len(values))
        for start in range(0, len(values), self.words_at_once):
            part = values[start : start + self.words_at_once]
            place = address if fixed else address + 4 * start
            data = b"".join((value & 0xFFFFFFFF).to_bytes(4, "big") for value in part)
            command = _WRITE_FIXED if fixed else _WRITE
            self._send(_header(command, len(part), place) + data, place, len(part))
            self.words_written += len(part)
            self.written_crc = zlib.crc32(data, self.written_crc)

    def resynchronise(self) -> int:
        """Keeps silent until the board has forgotten what it was told in part and nothing comes
        any more; returns the number of bytes dropped. LineFault GARBLED where bytes never end."""
        silence = _FORGOTTEN_S * self.time_scale + self._line_s(self._owed)
        dropped = 0
        for _ in range(_CHATTER):
            got = self.port.read(_GULP, silence)
            if not got:
                self._note("silence", dropped)
                self._owed = 0
                return dropped
            dropped += len(got)
            self.dropped += len(got)
        self._note("chatter", dropped)
        raise LineFault(
            Cause.GARBLED, f"{self.port.name} keeps sending though nothing was asked of it"
        )

    def pause(self, seconds: float) -> None:
        """Waits; bytes that come meanwhile are counted as strays and dropped."""
        end = self.port.now() + seconds
        while (left := end - self.port.now()) > 0:
            got = self.port.read(1, left)
            if not got:
                return
            self._stray(got + self.port.drain())

    def set_baud(self, baud: int) -> None:
        """Changes the host's rate, and all times with it."""
        self.port.set_baud(baud)
        self.baud = baud
        self._note("baud", baud)

    def _ask(self, address: int, count: int, fixed: bool, again: int) -> bytes:
        while True:
            try:
                return self._read_once(address, count, fixed)
            except LineFault as fault:
                if fault.cause in FINAL:
                    raise
                self.resynchronise()
                if not again:
                    raise
                again -= 1
                self.retried += 1

    def _read_once(self, address: int, count: int, fixed: bool) -> bytes:
        if late := self.port.drain():
            self._stray(late)
            self.resynchronise()  # more may be on its way, and would be taken for the answer
        packet = _header(_READ_FIXED if fixed else _READ, count, address)
        self._send(packet, address, count)
        wanted = 4 * count
        self.bytes_asked += wanted
        data = self.port.read(wanted, self._line_s(self._owed + wanted) + self.patience_s)
        more = b""
        if len(data) == wanted:  # a byte too many shows that these may not be the ones asked for
            more = self.port.read(1, self._line_s(_TAIL) / self.time_scale)
            more += self.port.drain() if more else b""
        self.bytes_read += len(data) + len(more)
        self.round_trips += 1
        fault = _judge(packet, wanted, data, more, self.port.name)
        if self.log is not None:
            self.log.read(wanted, data, more, None if fault is None else fault.cause.value)
        if fault is not None:
            raise fault
        self._owed = 0
        return data

    def _send(self, packet: bytes, address: int, words: int) -> None:
        if self.log is not None:
            self.log.write(packet, address, words)
        self._owed += len(packet)
        self.port.write(packet, self._line_s(self._owed) + self.patience_s)
        self.bytes_sent += len(packet)

    def _line_s(self, count: int) -> float:
        """Returns the longest that `count` bytes may take on the line, seconds."""
        return _SLACK * count * _BITS / self.baud * self.time_scale

    def _stray(self, data: bytes) -> None:
        self.strays += len(data)
        if self.log is not None:
            self.log.stray(data)

    def _note(self, what: str, value: int) -> None:
        if self.log is not None:
            self.log.note(what, value)


def _header(command: int, count: int, address: int) -> bytes:
    return bytes([command, count]) + (address // 4).to_bytes(4, "big")


def _judge(packet: bytes, wanted: int, data: bytes, more: bytes, name: str) -> LineFault | None:
    """Returns what is wrong with an answer of `data` and, beyond its length, `more`."""
    got = data + more
    if len(got) == wanted:
        return None
    if not got:
        return LineFault(Cause.SILENT, f"nothing came back from {name}")
    if got.startswith(packet):
        return LineFault(Cause.ECHO, f"{name} sent back the very bytes it was sent")
    if len(got) < wanted:
        return LineFault(Cause.SHORT, f"{len(got)} of {wanted} bytes came back from {name}")
    told = f"{len(got)} bytes came back from {name} where {wanted} were asked for"
    if len(got) >= wanted + _MORE_TEXT and _TEXT.fullmatch(got):
        text = " ".join(got.decode("ascii").split())[:40]
        return LineFault(
            Cause.GARBLED, f"{told}, as text: {text!r}",
            "that is another device or a console on this line: name the board's port",
        )  # fmt: skip
    return LineFault(Cause.GARBLED, told)


def _check_address(address: int, words: int) -> None:
    if address % 4 or not 0 <= address <= (1 << 32) - 4 * words or words < 0:
        raise InputError(
            "an address",
            "that of words in 32 bits of bytes",
            f"{address:#x} for {words} words",
            "give a multiple of 4",
        )
