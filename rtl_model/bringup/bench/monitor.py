"""What the line did to bytes, told by the board's own counters held against the host's.

Every byte that the host sends comes into `uart_rx_bytes` (or `uart_framing_errors`), every byte of
an answer into `uart_tx_bytes`; so the two ends' sums say which way bytes were lost or added, and
how many more of one than of the other. A byte that was changed leaves the sums alone:

    to the board     in a command or a length the board sends another number of bytes than were
                     asked for, and counts an unknown command or a watchdog abort; in the data of a
                     write the CRC-32 of words written is another; in an address most are of no
                     register, which the board counts as an error of its bus, and from a few others
                     the answer is another register's
    from the board   the number of bytes is right, and a second reading differs from the first

What stays open: an answer that was wrong once, where another register that one wrong bit of the
address could name holds the very same or cannot be asked without changing it. A lost byte and an
added one of the same way within one stage cancel each other.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import NamedTuple, TypeAlias

from rtl_model.bringup.bench.evidence import Evidence
from rtl_model.geometry import Geometry
from rtl_model.host import CsrMap, LineFault, Uartbone
from rtl_model.host.uartbone import FINAL
from rtl_model.registers import REGISTERS, Register, identifier

__all__ = ["LineMonitor"]

_TRIES = 12  # to read the counters twice alike
_COUNTERS = 7  # words from uart_rx_bytes to uart_writes_crc
_GROW = ("rx", "tx", "framing", "aborts", "unknown", "words")  # of the sums: the board's own
_WORD = 1 << 32
_ADDRESS_BITS = 30  # of a word's address on the line
_NEAR = 1 << 16  # a register that moves may have held a value so near to what it holds now
_TOLD_APART = 32  # bytes: a line does not lose so many one way and add as many the other way
_EXAMINED = 8  # wrong answers that are looked into, each at the cost of some readings
_MOVES = {  # besides those that reading changes: not the same when they are asked again
    "ctrl_uptime", "ctrl_bus_errors", "uart_rx_bytes", "uart_tx_bytes", "uart_shortest_low",
    "sensor_frames", "sensor_frame_clock", "sensor_rows_read", "sensor_spikes", "capture_state",
    "capture_rows", "capture_level",
}  # fmt: skip

_TABLE = {entry.address: entry for entry in REGISTERS}

_Other: TypeAlias = tuple[int, list[int], list[int]]
"""Address of an answer that was wrong, its words, and those that are right."""


class _Sums(NamedTuple):
    """Of both ends at one moment. `heard` and `rx` are those that arrived, `sent` and `tx` those
    that set out."""

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
    """Both ends' sums from a moment on. `evidence` says what happened since then, and begins anew.

    Nothing is known before `begin`, which reads the board's counters; these must be ours.
    """

    def __init__(self, bone: Uartbone, csr: CsrMap) -> None:
        self._bone, self._csr = bone, csr
        self._before: _Sums | None = None
        self._block = csr.register("uart_rx_bytes").address
        self._memories = min(csr.base("identifier_mem"), csr.base("pattern_mem"))
        self._seen = _WrongAnswers()
        self._errors = 0  # of the board's bus, when last looked at
        self._busy = False
        self.geometry: Geometry | None = None
        bone.on_other_answer = self.other_answer

    def begin(self) -> None:
        """Takes the sums as they are now. What befalls this reading itself stays open, unless the
        board has counted no more bytes than this host ever sent: then it began with it, at 0."""
        retried = self._bone.retried
        self._before = now = self._sums()
        early = self._bone.retried - retried
        if now is not None and early and now.rx + now.framing <= now.sent:
            self._before = _Sums(*[0] * len(_Sums._fields))
            self._seen.unfit = []
            early = 0
        self._seen.early += early

    def take_evidence(self, repeats: int = 0) -> Evidence:
        """What happened since `begin` or the last evidence. repeats: reads sent again meanwhile."""
        before, retried = self._before, self._bone.retried
        now = self._before = self._sums()
        seen, self._seen = self._seen, _WrongAnswers()
        repeats += self._bone.retried - retried
        if before is None or now is None:
            return Evidence(known=False, repeats=repeats)
        if any(_signed(getattr(now, name) - getattr(before, name)) < 0 for name in _GROW):
            return Evidence(known=False, repeats=repeats, anew=True)  # the board began anew
        arrived = now.rx + now.framing - before.rx - before.framing
        made = Evidence(
            to_board=_signed(arrived - (now.sent - before.sent)),
            from_board=_signed((now.heard - before.heard) - (now.tx - before.tx)),
            framing=_signed(now.framing - before.framing),
            aborts=_signed(now.aborts - before.aborts),
            unknown=_signed(now.unknown - before.unknown),
            unasked=_signed((now.tx - before.tx) - (now.asked - before.asked)),
            words=_signed((now.words - before.words) - (now.written - before.written)),
            crc=now.words_crc != now.written_crc,
            bus_errors=max(0, now.bus_errors - before.bus_errors) + seen.errors,
            misplaced=seen.misplaced,
            address=seen.address,
            early=seen.early,
            repeats=repeats,
        )
        if _began_anew(before, made):
            return Evidence(known=False, repeats=repeats, anew=True)
        if not (made.to_board or made.from_board or made.changed_to_board):
            # Only then may the readings that did not fit be held against those that did.
            self._look_back(seen, now)
        self._examine_all(seen, seen.wait)
        if made.to_board or made.changed_to_board:  # then other answers may follow from that
            return replace(made, address=seen.address)
        return replace(made, address=seen.address, answers=seen.answers, open=seen.open)

    def expect_reset(self) -> None:
        """Keeps what the board's reset is about to clear: the errors of its bus."""
        if self._before is None:
            return
        self._errors = 0
        self._seen.errors += max(0, self._bus_errors() - self._before.bus_errors)
        self._before = self._before._replace(bus_errors=0)

    def count_misplaced(self) -> None:
        """A request or a write did once not what it does when it is sent again."""
        self._bone.retried += 1
        self._seen.misplaced += 1

    def other_answer(self, address: int, got: list[int], right: list[int]) -> None:
        """An answer was wrong once: was it another register's, which one wrong bit of the request's
        address asks for? That is looked up; what cannot be looked up stays open."""
        if self._before is None:
            return  # `begin` counts it
        if self._seen.looked >= _EXAMINED:
            self._seen.open += 1
            return
        self._seen.looked += 1
        if self._busy or self.geometry is None:  # before that is known nothing is written either
            self._seen.wait.append((address, got, right))
            return
        self._examine_all(self._seen, [(address, got, right)])

    def _examine(self, seen: _WrongAnswers, address: int, got: list[int], right: list[int]) -> None:
        errors, before = self._bus_errors(), self._errors
        self._errors = errors
        if errors > before:  # an access to no register
            seen.address += 1
            return
        one = _octets(got, right) == 1
        verdicts = {self._holds(address ^ 4 << bit, got, one) for bit in range(_ADDRESS_BITS)}
        if True in verdicts and not one:
            seen.address += 1
        elif verdicts == {False}:
            seen.answers += 1
        else:
            seen.open += 1

    def _holds(self, address: int, got: list[int], one_octet: bool) -> bool | None:
        """Whether the words at an address are these; None where that cannot be known."""
        likely: bool | None = True
        for place, word in zip(range(address, address + 4 * len(got), 4), got, strict=True):
            entry = _TABLE.get(place)
            if entry is None and self.geometry is None and place >= self._memories:
                likely = None  # how far the memories reach is not known yet
                continue
            if entry is None and not self._in_memory(place):
                return False  # the board would have counted an error of its bus
            if entry is not None and entry.mode == "wo":
                if word == 0:  # as which it reads
                    continue
                return False
            if entry is not None and entry.name == "prbs_source" and one_octet:
                return False  # a random word is not all but a byte of another
            if entry is not None and entry.read_effect:
                likely = None
                continue
            value = self._bone.read_twice(place)[0] if not _moves(entry) else self._once(place)
            if value == word:
                continue
            if not _moves(entry) or abs(value - word) >= _NEAR:
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
        """Both ends' sums, once two readings of the board's counters in a row fit together: then
        neither was spoilt. None where they never do."""
        bone = self._bone
        self._busy = True
        try:
            for _ in range(_TRIES):
                try:
                    first = self._reading()
                    errors = self._bus_errors()  # between them: not every n-th byte hits both alike
                    second = self._reading()
                except LineFault as fault:
                    if fault.cause in FINAL:
                        raise
                    bone.retried += 1
                    continue
                if second.words == first.later(second):
                    self._errors = errors
                    return _summed(bone, second, errors)
                self._seen.unfit += [first, second]
                bone.resynchronise()
                bone.retried += 1
        finally:
            self._busy = False
        return None

    def _reading(self) -> _Reading:
        bone = self._bone
        words = bone.read(self._block, _COUNTERS, retry=False)
        return _Reading(words, bone.bytes_sent, bone.bytes_asked - 4 * _COUNTERS)

    def _look_back(self, seen: _WrongAnswers, now: _Sums) -> None:
        """Readings of the counters that did not fit, though not a byte was lost or added: what
        they had to be follows from the one that did."""
        if not seen.unfit:
            return
        own = 4 * _COUNTERS
        words = [now.rx, now.tx - own + 4, now.framing, now.aborts, now.unknown, now.words]
        fits = _Reading([*words, now.words_crc], now.sent, now.asked - own)
        others = [(self._block, one.words, fits.later(one)) for one in seen.unfit]
        wrong = [other for other in others if other[1] != other[2]]
        self._examine_all(seen, wrong[:_EXAMINED])

    def _examine_all(self, seen: _WrongAnswers, others: list[_Other]) -> None:
        self._busy = True
        try:
            for address, got, right in others:
                self._examine(seen, address, got, right)
        except LineFault as fault:
            if fault.cause in FINAL:
                raise
            seen.open += 1
        finally:
            self._busy = False


class _Reading(NamedTuple):
    """A reading of the counters, and the host's sums then: bytes sent with its request, bytes asked
    for before its answer."""

    words: list[int]
    sent: int
    asked: int

    def later(self, other: _Reading) -> list[int]:
        """What another reading must be for this one, where every byte between them arrived."""
        rx, tx, *rest = self.words
        return [(rx + other.sent - self.sent) % _WORD, (tx + other.asked - self.asked) % _WORD,
                *rest]  # fmt: skip


def _summed(bone: Uartbone, last: _Reading, errors: int) -> _Sums:
    """The sums behind a reading. It finds its own request counted, and one word of its answer."""
    rx, tx, framing, aborts, unknown, words, crc = last.words
    sums = _Sums(
        sent=bone.bytes_sent, rx=rx, tx=tx + 4 * (len(last.words) - 1), heard=bone.bytes_heard,
        asked=bone.bytes_asked, framing=framing, aborts=aborts, unknown=unknown, words=words,
        words_crc=crc, written=bone.words_written, written_crc=bone.written_crc,
        bus_errors=errors,
    )  # fmt: skip
    bone.written_crc = crc  # from here on it goes with the board's
    return sums


@dataclass
class _WrongAnswers:
    """Answers that were wrong once."""

    address: int = 0
    answers: int = 0
    open: int = 0
    early: int = 0
    looked: int = 0
    errors: int = 0
    misplaced: int = 0
    wait: list[_Other] = field(default_factory=list)
    unfit: list[_Reading] = field(default_factory=list)


def _began_anew(before: _Sums, made: Evidence) -> bool:
    """Whether the board's counters fell to 0. Then they miss all that it had counted before, both
    ways, and what an answer that was cut short left out. Lost bytes alone never show as bytes added
    from the board."""
    return (
        before.rx >= _TOLD_APART
        and -made.to_board >= before.rx + before.framing
        and 2 * made.from_board >= before.tx > 0
    )


def _octets(got: list[int], right: list[int]) -> int:
    """In how many bytes two answers differ."""
    return sum(
        bool((one ^ other) >> shift & 0xFF)
        for one, other in zip(got, right, strict=True)
        for shift in (0, 8, 16, 24)
    )


def _moves(entry: Register | None) -> bool:
    return entry is not None and entry.name in _MOVES


def _signed(difference: int) -> int:
    """A difference of counters modulo 2^32."""
    return (difference + _WORD // 2) % _WORD - _WORD // 2
