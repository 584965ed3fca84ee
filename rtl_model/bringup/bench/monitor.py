"""Transmission errors of the line, found by comparing the board's counters with the host's.

The board counts every byte that it receives in `uart_rx_bytes` (or `uart_framing_errors`) and every
byte of an answer in `uart_tx_bytes`. The differences from the host's counts are the net numbers of
bytes lost or added in each direction. A changed byte does not alter these counts:

    to the board     In a command or a length, the board sends a number of bytes that was not
                     requested, or counts an unknown command or a watchdog abort. In the data of a
                     write, the CRC-32 of the written words differs. In an address, most values
                     belong to no register, which the board counts as a bus error; a few belong to
                     another register, which answers.
    from the board   The number of bytes is right, and a second reading differs from the first.

One case is undecidable: an answer that was wrong once, if a register whose address differs in one
bit holds the same value or cannot be read without side effects. A lost and an added byte of the
same direction within one stage cancel.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import NamedTuple, TypeAlias

from rtl_model.bringup.bench.evidence import Evidence
from rtl_model.geometry import Geometry
from rtl_model.host import CsrMap, LineFault, Uartbone
from rtl_model.host.uartbone import FINAL
from rtl_model.registers import REGISTERS, Register, identifier

_TRIES = 12  # readings until two agree
_COUNTERS = 7  # words from uart_rx_bytes to uart_writes_crc
_GROW = ("rx", "tx", "framing", "aborts", "unknown", "words")  # counts of the board
_WORD = 1 << 32
_ADDRESS_BITS = 30  # of a word's address on the line
_NEAR = 1 << 16  # a changing register may have held a value this close to its present one
_RESTART_BYTES = 32  # no line loses so many bytes in one direction and adds them in the other
_EXAMINED = 8  # most wrong answers that are examined; each needs several readings
_CHANGING = {  # registers that change by themselves
    "ctrl_uptime", "ctrl_bus_errors", "uart_rx_bytes", "uart_tx_bytes", "uart_shortest_low",
    "sensor_frames", "sensor_frame_clock", "sensor_rows_read", "sensor_spikes", "capture_state",
    "capture_rows", "capture_level",
}  # fmt: skip

_TABLE = {entry.address: entry for entry in REGISTERS}

_Other: TypeAlias = tuple[int, list[int], list[int]]
"""Address of a wrong answer, its words, and the right words."""


class _Sums(NamedTuple):
    """Counts at both ends at one moment, in bytes unless noted.

    Attributes:
        sent, heard, asked: counts of the host: bytes sent, received and requested.
        rx, tx: counts of the board: bytes received and sent.
        framing, aborts, unknown: framing errors, watchdog aborts and unknown commands.
        words, words_crc: words written by the board's count, and their CRC-32.
        written, written_crc: the same by the host's count.
        bus_errors: accesses to no register.
    """

    sent: int
    rx: int
    tx: int
    heard: int
    asked: int
    framing: int
    aborts: int
    unknown: int
    words: int
    words_crc: int
    written: int
    written_crc: int
    bus_errors: int


class LineMonitor:
    """Compares the counts at both ends of the line over an interval.

    `begin` must be called first. It reads the counters, which only a board of this project has.
    `take_evidence` evaluates the interval since then and starts the next one.

    Attributes:
        geometry: geometry of the board; None until it is known.
    """

    def __init__(self, bone: Uartbone, csr: CsrMap) -> None:
        self._bone, self._csr = bone, csr
        self._before: _Sums | None = None
        self._block = csr.register("uart_rx_bytes").address
        self._memories = min(csr.base("identifier_mem"), csr.base("pattern_mem"))
        self._wrong = _WrongAnswers()
        self._errors = 0  # bus errors of the board at the last reading
        self._busy = False
        self._restarted = False  # whether the board restarted before the first interval
        self.geometry: Geometry | None = None
        bone.on_other_answer = self.other_answer

    def begin(self) -> None:
        """Reads the counts at the start of the first interval.

        The direction of an error in this reading is unknown, unless the board has counted no more
        bytes than this host has sent: then the board started from 0 together with the host.
        """
        retried = self._bone.retried
        self._before = now = self._sums()
        early = self._bone.retried - retried
        self._restarted = now is not None and _counts_less(now)
        if now is not None and early and now.rx + now.framing <= now.sent:
            self._before = _Sums(*[0] * len(_Sums._fields))
            self._wrong.unfit = []
            early = 0
        self._wrong.early += early

    def take_evidence(self, repeats: int = 0) -> Evidence:
        """Evaluates the interval since `begin` or the last evidence, and starts the next one.

        Args:
            repeats: reads that were repeated in the interval.
        """
        before, retried = self._before, self._bone.retried
        now = self._before = self._sums()
        wrong, self._wrong = self._wrong, _WrongAnswers()
        repeats += self._bone.retried - retried
        restarted, self._restarted = self._restarted, False
        if restarted or before is None or now is None:
            return Evidence(known=False, repeats=repeats, restarted=restarted)
        if any(_signed(getattr(now, name) - getattr(before, name)) < 0 for name in _GROW):
            return Evidence(known=False, repeats=repeats, restarted=True)
        arrived = now.rx + now.framing - before.rx - before.framing
        evidence = Evidence(
            to_board=_signed(arrived - (now.sent - before.sent)),
            from_board=_signed((now.heard - before.heard) - (now.tx - before.tx)),
            framing=_signed(now.framing - before.framing),
            aborts=_signed(now.aborts - before.aborts),
            unknown=_signed(now.unknown - before.unknown),
            unsolicited=_signed((now.tx - before.tx) - (now.asked - before.asked)),
            words=_signed((now.words - before.words) - (now.written - before.written)),
            crc=now.words_crc != now.written_crc,
            bus_errors=max(0, now.bus_errors - before.bus_errors) + wrong.errors,
            misplaced=wrong.misplaced,
            address=wrong.address,
            early=wrong.early,
            repeats=repeats,
        )
        if _has_restarted(before, evidence):
            return Evidence(known=False, repeats=repeats, restarted=True)
        if not (evidence.to_board or evidence.from_board or evidence.changed_to_board):
            # Only then can inconsistent readings be compared with the consistent one.
            self._check_unfit(wrong, now)
        self._examine_all(wrong, wrong.wait)
        if (
            evidence.to_board or evidence.changed_to_board
        ):  # the wrong answers may be its consequence
            return replace(evidence, address=wrong.address)
        return replace(evidence, address=wrong.address, answers=wrong.answers, open=wrong.open)

    def expect_reset(self) -> None:
        """Saves the count of bus errors before a reset of the board clears it."""
        if self._before is None:
            return
        self._errors = 0
        self._wrong.errors += max(0, self._bus_errors() - self._before.bus_errors)
        self._before = self._before._replace(bus_errors=0)

    def count_misplaced(self) -> None:
        """Counts a request or a write that failed once and passed when it was repeated."""
        self._bone.retried += 1
        self._wrong.misplaced += 1

    def other_answer(self, address: int, got: list[int], right: list[int]) -> None:
        """Examines an answer that was wrong once.

        If a register whose address differs in one bit holds the wrong words, the request was
        changed on its way to the board. What cannot be read leaves the direction undecided.
        """
        if self._before is None:
            return  # `begin` counts it
        if self._wrong.examined >= _EXAMINED:
            self._wrong.open += 1
            return
        self._wrong.examined += 1
        if self._busy or self.geometry is None:  # nothing is written before it is known
            self._wrong.wait.append((address, got, right))
            return
        self._examine_all(self._wrong, [(address, got, right)])

    def _examine(
        self, wrong: _WrongAnswers, address: int, got: list[int], right: list[int]
    ) -> None:
        errors, before = self._bus_errors(), self._errors
        self._errors = errors
        if errors > before:  # an access to no register
            wrong.address += 1
            return
        one = _octets(got, right) == 1
        verdicts = {self._holds(address ^ 4 << bit, got, one) for bit in range(_ADDRESS_BITS)}
        if True in verdicts and not one:
            wrong.address += 1
        elif verdicts == {False}:
            wrong.answers += 1
        else:
            wrong.open += 1

    def _holds(self, address: int, got: list[int], one_octet: bool) -> bool | None:
        """Whether the words at an address are these; None if it cannot be known."""
        likely: bool | None = True
        for place, word in zip(range(address, address + 4 * len(got), 4), got, strict=True):
            entry = _TABLE.get(place)
            if entry is None and self.geometry is None and place >= self._memories:
                likely = None  # the memories' sizes are unknown
                continue
            if entry is None and not self._in_memory(place):
                return False  # the board would have counted a bus error
            if entry is not None and entry.mode == "wo":
                if word == 0:  # a write-only register reads as 0
                    continue
                return False
            if entry is not None and entry.name == "prbs_source" and one_octet:
                return False  # random words do not agree in three bytes
            if entry is not None and entry.read_effect:
                likely = None
                continue
            value = self._bone.read_twice(place)[0] if not _changes(entry) else self._once(place)
            if value == word:
                continue
            if not _changes(entry) or abs(value - word) >= _NEAR:
                return False
            likely = None
        return likely

    def _once(self, place: int) -> int:
        return self._bone.read(place)[0]

    def _in_memory(self, place: int) -> bool:
        if self.geometry is None:
            return False
        text = self._csr.base("identifier_mem"), 4 * (len(identifier(self.geometry)) + 1)
        image = self._csr.base("pattern_mem"), self.geometry.pattern_bytes
        return any(base <= place < base + length for base, length in (text, image))

    def _bus_errors(self) -> int:
        return self._bone.read_twice(self._csr.register("ctrl_bus_errors").address)[0]

    def _sums(self) -> _Sums | None:
        """The counts at both ends, from two consecutive readings of the board's counters that are
        consistent, so that neither contains an error; None if no two are."""
        bone = self._bone
        self._busy = True
        try:
            for _ in range(_TRIES):
                try:
                    first = self._reading()
                    errors = (
                        self._bus_errors()
                    )  # between the readings, so that periodic errors affect them differently
                    second = self._reading()
                except LineFault as fault:
                    if fault.cause in FINAL:
                        raise
                    bone.retried += 1
                    continue
                if second.words == first.later(second):
                    self._errors = errors
                    return _summed(bone, second, errors)
                self._wrong.unfit += [first, second]
                bone.resynchronise()
                bone.retried += 1
        finally:
            self._busy = False
        return None

    def _reading(self) -> _Reading:
        bone = self._bone
        words = bone.read(self._block, _COUNTERS, retry=False)
        return _Reading(words, bone.bytes_sent, bone.bytes_asked - 4 * _COUNTERS)

    def _check_unfit(self, wrong: _WrongAnswers, now: _Sums) -> None:
        """Examines inconsistent readings of the counters in an interval without lost or added
        bytes: their right values follow from the consistent reading."""
        if not wrong.unfit:
            return
        block = 4 * _COUNTERS  # bytes of one reading
        words = [now.rx, now.tx - block + 4, now.framing, now.aborts, now.unknown, now.words]
        fits = _Reading([*words, now.words_crc], now.sent, now.asked - block)
        others = [(self._block, one.words, fits.later(one)) for one in wrong.unfit]
        different = [other for other in others if other[1] != other[2]]
        self._examine_all(wrong, different[:_EXAMINED])

    def _examine_all(self, wrong: _WrongAnswers, others: list[_Other]) -> None:
        self._busy = True
        try:
            for address, got, right in others:
                self._examine(wrong, address, got, right)
        except LineFault as fault:
            if fault.cause in FINAL:
                raise
            wrong.open += 1
        finally:
            self._busy = False


class _Reading(NamedTuple):
    """A reading of the board's counters.

    Attributes:
        words: values of the counters.
        sent: bytes that the host had sent, including the request.
        asked: bytes that the host had requested before this answer.
    """

    words: list[int]
    sent: int
    asked: int

    def later(self, other: _Reading) -> list[int]:
        """The words of another reading, if every byte between this one and the other arrived."""
        rx, tx, *rest = self.words
        return [(rx + other.sent - self.sent) % _WORD, (tx + other.asked - self.asked) % _WORD,
                *rest]  # fmt: skip


def _summed(bone: Uartbone, last: _Reading, errors: int) -> _Sums:
    """The counts after a reading, which contains its own request and one word of its answer."""
    rx, tx, framing, aborts, unknown, words, crc = last.words
    sums = _Sums(
        sent=bone.bytes_sent, rx=rx, tx=tx + 4 * (len(last.words) - 1), heard=bone.bytes_heard,
        asked=bone.bytes_asked, framing=framing, aborts=aborts, unknown=unknown, words=words,
        words_crc=crc, written=bone.words_written, written_crc=bone.written_crc,
        bus_errors=errors,
    )  # fmt: skip
    bone.written_crc = crc  # both ends continue from the same value
    return sums


@dataclass
class _WrongAnswers:
    """Answers that were wrong once, in one interval.

    Attributes:
        address: answers of another register.
        answers: changed on the way from the board.
        open: answers of undecided direction.
        early: wrong while the counters were first read.
        examined: number of answers examined so far.
        errors: bus errors before a reset of the board.
        misplaced: requests and writes that failed once.
        wait: answers to examine later.
        unfit: inconsistent readings of the counters.
    """

    address: int = 0
    answers: int = 0
    open: int = 0
    early: int = 0
    examined: int = 0
    errors: int = 0
    misplaced: int = 0
    wait: list[_Other] = field(default_factory=list)
    unfit: list[_Reading] = field(default_factory=list)


def _has_restarted(before: _Sums, evidence: Evidence) -> bool:
    """Whether the board's counters restarted from 0.

    Then all bytes that it had counted before are missing in both directions. Lost bytes alone never
    appear as bytes added from the board.
    """
    return (
        before.rx >= _RESTART_BYTES
        and -evidence.to_board >= before.rx + before.framing
        and 2 * evidence.from_board >= before.tx > 0
    )


def _counts_less(now: _Sums) -> bool:
    """Whether the board counted fewer bytes in each direction than this host, so it restarted."""
    return min(now.sent - now.rx - now.framing, now.heard - now.tx) >= _RESTART_BYTES // 2


def _octets(got: list[int], right: list[int]) -> int:
    """Number of bytes in which two answers differ."""
    return sum(
        bool((one ^ other) >> shift & 0xFF)
        for one, other in zip(got, right, strict=True)
        for shift in (0, 8, 16, 24)
    )


def _changes(entry: Register | None) -> bool:
    return entry is not None and entry.name in _CHANGING


def _signed(difference: int) -> int:
    """A difference of counters modulo 2^32."""
    return (difference + _WORD // 2) % _WORD - _WORD // 2
