"""LiteX's uartbone from the host's side: words at byte addresses, over any port.

The protocol has no acknowledgement, no CRC and no status. The board drops a transaction 100 ms
after its first byte (litex/soc/cores/uart.py). Therefore a transaction takes less than 50 ms of
line time, only one request is outstanding, and after any fault the host keeps silent until the
board has dropped the transaction. A plain read cannot detect a flipped bit. `read_twice`, the
counters of writes (`Board.write`) and the CRC of captured rows can.
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
    from rtl_model.host.log import LineLog

PATIENCE_S, SIMULATED_PATIENCE_S = 0.3, 3.0
"""Longest wait for an answer beyond line time, s. A busy machine may suspend the thread of a
simulated board."""

_WRITE, _READ, _WRITE_FIXED, _READ_FIXED = 1, 2, 3, 4
_HEADER = 6  # bytes: command, length, word address
_BITS = 10  # of a byte on the line, 8N1
_WORDS = 255  # most words of a transaction; length 0 would be 256
_TRANSACTION_S = 0.05  # half of the board's watchdog
_FORGOTTEN_S = 0.11  # silence after which a board has dropped a transaction
_CHATTER = 20  # failed waits for silence before a fault is raised
_GULP = 1 << 16  # bytes; more than any answer, so that a read of them waits for silence
_TAIL = 2  # bytes' time of silence that is checked after an answer; later bytes of a board slower
# than real time count as strays before the next request
_TEXT = re.compile(rb"[ -~\t\r\n]+")
_MORE_TEXT = 4  # least surplus bytes of an answer that is taken for text
_SLACK = 1.25  # factor of line time for stop bits, gaps and clock error

FINAL = (Cause.GONE, Cause.STUCK, Cause.ECHO, Cause.DIFFERS)
"""Causes that neither a repeated request nor another baud can remove."""

BAUD_MIN = int((_HEADER + 4) * _BITS / _TRANSACTION_S) + 1
"""Lowest baud at which a transaction of one word takes less than 50 ms."""


class Uartbone:
    """Master of a bus behind a serial port.

    Args:
        port: port to the board.
        baud: baud of the line; the port's if None.
        time_scale: seconds of the host's time to a second of the board's clock; more than 1 for a
            simulated board that is slower than real time.
        patience_s: wait for an answer beyond line time, s, for the buffers of adapter and system.
        retries: number of retries of a read without side effect, each after a silence. Writes and
            reads of a FIFO are never repeated.
        log: records every transaction, None for no log.

    Attributes:
        bytes_sent: number of bytes sent to the board.
        bytes_read: received as answers.
        strays: bytes received without a request.
        dropped: bytes discarded while the line was brought to silence.
        bytes_asked: total length of all requested answers, including failed ones.
        words_written: words sent in writes.
        written_crc: CRC-32 of these words, continued from any value that is assigned.
        retried: number of repeated reads.
        round_trips: number of answers, including failed ones.
        on_other_answer: called with (address, received words, right words) for an answer of the
            right length that a second reading has proved wrong; None for no call.
    """

    confirms = False

    def __init__(
        self,
        port: Port,
        *,
        baud: int | None = None,
        time_scale: float = 1.0,
        patience_s: float = PATIENCE_S,
        retries: int = 2,
        log: LineLog | None = None,
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
        self._outstanding = 0  # bytes sent since the last answer, possibly still in a buffer
        self.bytes_sent = self.bytes_read = self.bytes_asked = self.dropped = 0
        self.retried = self.strays = self.round_trips = 0
        self.words_written = self.written_crc = 0
        self.on_other_answer: Callable[[int, list[int], list[int]], None] | None = None

    @property
    def bytes_heard(self) -> int:
        """All bytes received: answers, strays and dropped ones."""
        return self.bytes_read + self.strays + self.dropped

    @property
    def words_at_once(self) -> int:
        """Most words of one transaction: less than 50 ms of line time, at most 255."""
        bytes_at_once = _TRANSACTION_S * self.baud / _BITS
        return max(1, min(_WORDS, int((bytes_at_once - _HEADER - 1e-9) // 4)))

    def read(
        self, address: int, words: int = 1, *, fixed: bool = False, retry: bool | None = None
    ) -> list[int]:
        """Reads words.

        Args:
            address: address of the first word, bytes.
            words: number of words.
            fixed: whether all are read from the same address.
            retry: whether the read may be repeated; by default unless `fixed`.

        Raises:
            LineFault: SILENT, SHORT, GARBLED or ECHO. The line is then silent and the board ready
                for a command.
        """
        check_address(address, 1 if fixed else words)
        again = self.retries if (not fixed if retry is None else retry) else 0
        values: list[int] = []
        while len(values) < words:
            count = min(words - len(values), self.words_at_once)
            place = address if fixed else address + 4 * len(values)
            data = self._ask(place, count, fixed, again)
            values += [int.from_bytes(data[n : n + 4], "big") for n in range(0, len(data), 4)]
        return values

    def read_twice(self, address: int, words: int = 1) -> list[int]:
        """Reads words that do not change by themselves, until two consecutive readings agree.

        An error remains undetected only if it occurs identically in both. Raises LineFault GARBLED
        if no two consecutive readings agree.
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
        raise LineFault(Cause.GARBLED, f"no two consecutive readings of {address:#x} agreed")

    def other_answer(
        self, address: int, got: list[int], right: list[int], *, counted: bool = False
    ) -> None:
        """Reports an answer of the right length that was wrong to `on_other_answer`.

        Args:
            address: address of the first word, bytes.
            got: received words.
            right: words of the repeated reading.
            counted: whether `retried` already includes it.
        """
        self.retried += not counted
        if self.on_other_answer is not None:
            self.on_other_answer(address, got, right)

    def write(self, address: int, values: Sequence[int] | int, *, fixed: bool = False) -> None:
        """Writes words, without confirmation that they arrive.

        A write that was sent in part is never repeated. Raises LineFault STUCK or GONE.

        Args:
            address: address of the first word, bytes.
            values: word, or several, of which the lower 32 bits are written.
            fixed: whether all are written to the same address.
        """
        values = [values] if isinstance(values, int) else list(values)
        check_address(address, 1 if fixed else len(values))
        for start in range(0, len(values), self.words_at_once):
            part = values[start : start + self.words_at_once]
            place = address if fixed else address + 4 * start
            packet = write_request(place, part, fixed=fixed)
            self._send(packet, place, len(part))
            self.words_written += len(part)
            self.written_crc = zlib.crc32(packet[_HEADER:], self.written_crc)

    def ask(self, address: int) -> bytes:
        """Requests one word and returns all bytes that come back, even if these are not four.

        The caller must resynchronise. Raises LineFault STUCK or GONE.
        """
        self._send(read_request(address, 1), address, 1)
        self.bytes_asked += 4
        data = self.port.read(4, self._line_s(self._outstanding + 4) + self.patience_s)
        more = b""
        while len(data) == 4 and (byte := self.port.read(1, self._line_s(_TAIL))):
            more += byte
        self.bytes_read += len(data) + len(more)
        self.round_trips += 1
        if self.log is not None:
            self.log.read(4, data, more, None)
        return data + more

    def resynchronise(self) -> int:
        """Keeps silent until the board has dropped an incomplete transaction and sends nothing.

        Returns the number of dropped bytes. Raises LineFault GARBLED if the board keeps sending.
        """
        silence = _FORGOTTEN_S * self.time_scale + self._line_s(self._outstanding)
        dropped = 0
        for _ in range(_CHATTER):
            got = self.port.read(_GULP, silence)
            if not got:
                self._note("silence", dropped)
                self._outstanding = 0
                return dropped
            dropped += len(got)
            self.dropped += len(got)
        self._note("chatter", dropped)
        raise LineFault(Cause.GARBLED, f"{self.port.name} keeps sending without a request")

    def pause(self, seconds: float) -> None:
        """Waits. Bytes that arrive meanwhile are counted as strays and dropped."""
        end = self.port.now() + seconds
        while (left := end - self.port.now()) > 0:
            got = self.port.read(1, left)
            if not got:
                return
            self._stray(got + self.port.drain())

    def set_baud(self, baud: int) -> None:
        """Changes the host's rate, and all waiting times accordingly."""
        self.port.set_baud(baud)
        self.baud = baud
        self._note("baud", baud)

    def line_s(self, count: int) -> float:
        """Duration of `count` bytes on the line at the host's baud, s."""
        return _BITS * count / self.baud

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
        if strays := self.port.drain():
            self._stray(strays)
            self.resynchronise()  # later bytes would be taken for the answer
        packet = read_request(address, count, fixed=fixed)
        self._send(packet, address, count)
        wanted = 4 * count
        self.bytes_asked += wanted
        data = self.port.read(wanted, self._line_s(self._outstanding + wanted) + self.patience_s)
        more = b""
        if len(data) == wanted:  # a surplus byte shows that this may be another answer
            more = self.port.read(1, self._line_s(_TAIL) / self.time_scale)
            more += self.port.drain() if more else b""
        self.bytes_read += len(data) + len(more)
        self.round_trips += 1
        fault = _judge(packet, wanted, data, more, self.port.name)
        if self.log is not None:
            self.log.read(wanted, data, more, None if fault is None else fault.cause.value)
        if fault is not None:
            raise fault
        self._outstanding = 0
        return data

    def _send(self, packet: bytes, address: int, words: int) -> None:
        if self.log is not None:
            self.log.write(packet, address, words)
        self._outstanding += len(packet)
        self.port.write(packet, self._line_s(self._outstanding) + self.patience_s)
        self.bytes_sent += len(packet)

    def _line_s(self, count: int) -> float:
        """Longest duration of `count` bytes on the line, s."""
        return _SLACK * count * _BITS / self.baud * self.time_scale

    def _stray(self, data: bytes) -> None:
        self.strays += len(data)
        if self.log is not None:
            self.log.stray(data)

    def _note(self, what: str, value: int) -> None:
        if self.log is not None:
            self.log.note(what, value)


def read_request(address: int, words: int, *, fixed: bool = False) -> bytes:
    """The bytes that request words; arguments as in `Uartbone.read`."""
    return _header(_READ_FIXED if fixed else _READ, words, address)


def write_request(address: int, values: Sequence[int], *, fixed: bool = False) -> bytes:
    """The bytes that write words; arguments as in `Uartbone.write`."""
    data = b"".join((value & 0xFFFFFFFF).to_bytes(4, "big") for value in values)
    return _header(_WRITE_FIXED if fixed else _WRITE, len(values), address) + data


def _header(command: int, count: int, address: int) -> bytes:
    return bytes([command, count]) + (address // 4).to_bytes(4, "big")


def _judge(packet: bytes, wanted: int, data: bytes, more: bytes, name: str) -> LineFault | None:
    """The fault of an answer with the surplus bytes `more`; None for a right one."""
    got = data + more
    if len(got) == wanted:
        return None
    if not got:
        return LineFault(Cause.SILENT, f"nothing came back from {name}")
    if got.startswith(packet):
        return LineFault(Cause.ECHO, f"{name} sent back the bytes of the request")
    if len(got) < wanted:
        return LineFault(Cause.SHORT, f"{len(got)} of {wanted} bytes came back from {name}")
    text = f"{len(got)} bytes came back from {name}, not {wanted}"
    if len(got) >= wanted + _MORE_TEXT and _TEXT.fullmatch(got):
        words = " ".join(got.decode("ascii").split())[:40]
        return LineFault(
            Cause.GARBLED, f"{text}, as text: {words!r}",
            "that is another device or a console on this line: name the board's port",
        )  # fmt: skip
    return LineFault(Cause.GARBLED, text)


def check_address(address: int, words: int) -> None:
    """Raises InputError unless `words` words lie at a byte address below 2^32."""
    if address % 4 or not 0 <= address <= (1 << 32) - 4 * words or words < 0:
        raise InputError(
            "an address",
            "that of words below 2^32 bytes",
            f"{address:#x} for {words} words",
            "give a multiple of 4",
        )
