"""LiteX's Etherbone from the host's side: words at byte addresses, over UDP.

UDP may lose, repeat and reorder packets, and acknowledges nothing. This file makes repetition
harmless:

    read     has no side effect, so it is repeated until an answer arrives. Many are in flight.
             A queue is read once, and never by an answer that could be lost unnoticed: the captured
             rows are read by address (`capture_mem`).
    write    is numbered (`write_mem`), and the board performs a number once, in order. Its packet
             also reads the next number, which confirms it and all before it. Writes that arrive
             after a lost one are refused by the board and sent again (go-back-N).

Another design has no `write_mem`. There a packet writes and reads the same address. It is repeated
until it is answered, and so it may be performed more than once.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from cosim import InputError
from rtl_model.host.ether.exchange import Exchange, PacketPort, is_answered, silent
from rtl_model.host.ether.packet import MOST_WORDS, Words, probe, record_packet
from rtl_model.host.faults import Cause, LineFault
from rtl_model.host.uartbone import PATIENCE_S, check_address
from rtl_model.registers import MAGIC, MEMORIES, VERSION

if TYPE_CHECKING:
    from rtl_model.host.log import LineLog

WRITE_OVERHEAD = 5
"""Words of a numbered write's record besides its data and one address: head, second address, and
the word read."""

WRITE_MEM = next(memory.address for memory in MEMORIES if memory.name == "write_mem")
"""Byte address of the numbered writes."""

_HEAD = 3  # words of a numbered write before its data
_LEAST_WORDS = 8  # a packet with so few words passes every network
_WORD = 1 << 32
_PROBES, _PROBE_WAIT_S = 8, 0.25


class Etherbone:
    """Master of a bus behind a network.

    Args:
        port: socket of the board.
        time_scale: seconds of the host's time to a second of the board's clock.
        patience_s: longest usual wait for an answer, s. After four times that without any answer
            the board is silent.
        log: records every packet, None for no log.

    Attributes:
        exchange: packets in flight, their counts and round trip.
        words_at_once: most words of one packet; halved if only shorter packets are answered.
        retried: requests that were repeated.
        round_trips: number of answers.
    """

    confirms = True
    """Whether the line confirms every write."""

    def __init__(
        self,
        port: PacketPort,
        *,
        time_scale: float = 1.0,
        patience_s: float = PATIENCE_S,
        log: LineLog | None = None,
    ) -> None:
        if not time_scale > 0:
            raise InputError("the time scale", "above 0", str(time_scale), "give another")
        self.port, self.time_scale, self.patience_s = port, time_scale, patience_s
        self.exchange = Exchange(port, patience_s, log)
        self.words_at_once = MOST_WORDS
        self._numbered: bool | None = None  # whether the board has write_mem; None: unknown
        self._number: int | None = None  # next number; None: unknown

    @property
    def retried(self) -> int:
        """Requests that were given up and repeated, and late ones."""
        return self.exchange.counts.lost + self.exchange.counts.late

    @property
    def round_trips(self) -> int:
        """Number of answers."""
        return self.exchange.counts.answered

    def line_s(self, count: int) -> float:
        """Duration of bytes on the line, s: 0, because a network's is unknown."""
        return 0.0

    def probe(self) -> float:
        """Sends Etherbone probes until one is answered; returns its round trip, s.

        Raises LineFault SILENT, or GARBLED if datagrams of another kind arrive.
        """
        port, begun = self.port, self.port.now()
        port.refused = False
        wait = max(_PROBE_WAIT_S, self.patience_s / _PROBES)
        others = 0
        for _ in range(_PROBES):
            sent = port.now()
            port.send(probe(0))
            while (left := sent + wait - port.now()) > 0:
                data = port.receive(left)
                # Etherbone's magic number, and the flag of an answer to a probe
                if data is not None and data[:2] == b"\x4e\x6f" and len(data) > 2 and data[2] & 2:
                    return port.now() - sent
                if data is None and port.refused:
                    break
                others += data is not None
            if port.refused and port.now() - begun > wait:
                break
        if port.refused:
            raise LineFault(
                Cause.SILENT, f"no program listens at {port.name}",
                "check address and port, or start `viform board virtual --udp HOST`",
            )  # fmt: skip
        if others:
            raise LineFault(
                Cause.GARBLED,
                f"{others} datagrams from {port.name}, none of them the answer to a probe",
                "check address and port",
            )
        raise silent(port, port.now() - begun, False)

    def require_answer(self) -> None:
        """Raises InputError, which says what to check, if no probe is answered."""
        try:
            self.probe()
        except LineFault as fault:
            given = {Cause.SILENT: "silent", Cause.GARBLED: "another program's or design's"}
            if fault.cause not in given:
                raise
            raise InputError(
                self.port.name, "the address of a board that answers",
                f"{given[fault.cause]} ({fault.text})", fault.advice,
            ) from fault  # fmt: skip

    def read(
        self, address: int, words: int = 1, *, fixed: bool = False, retry: bool | None = None
    ) -> list[int]:
        """Reads words.

        Args:
            address: address of the first word, bytes.
            words: number of words.
            fixed: whether all are read from the same address.
            retry: whether the read may be repeated; by default unless `fixed`.

        Raises LineFault SILENT, GONE or, for an answer to a read that may not be repeated, SHORT.
        """
        check_address(address, 1 if fixed else words)
        if not fixed if retry is None else retry:
            return list(map(int, self.read_addresses(_places(address, words, fixed))))
        values: list[int] = []
        while len(values) < words:
            count = min(words - len(values), self.words_at_once)
            place = address if fixed else address + 4 * len(values)
            data = self._once(_places(place, count, fixed).tobytes())
            values += np.frombuffer(data, ">u4").tolist()
        return values

    def read_twice(self, address: int, words: int = 1) -> list[int]:
        """Reads words. Once suffices, because each packet has checksums."""
        return self.read(address, words)

    def read_words(self, address: int, words: int) -> Words:
        """Reads words from consecutive addresses; see `read_addresses`.

        Args:
            address: address of the first word, bytes.
            words: number of words.
        """
        check_address(address, words)
        return self.read_addresses(_places(address, words, False))

    def read_addresses(self, addresses: Words) -> Words:
        """Reads words at any byte addresses, with many requests in flight.

        Args:
            addresses: (n,) uint32, of words that may be read again without effect.

        Raises LineFault SILENT or GONE.
        """
        every = addresses.astype(">u4", copy=False).tobytes()
        while True:
            size = 4 * self.words_at_once
            try:
                parts = self.read_blocks(
                    [every[at : at + size] for at in range(0, len(every), size)]
                )
            except LineFault as fault:
                if fault.cause is not Cause.SILENT or not self._shorten(every, size):
                    raise
                continue
            return np.frombuffer(b"".join(parts), ">u4")

    def write(self, address: int, values: Sequence[int] | int, *, fixed: bool = False) -> None:
        """Writes words; every write is confirmed.

        Args:
            address: address of the first word, bytes.
            values: word, or several, of which the lower 32 bits are written.
            fixed: whether all are written to the same address.

        Raises LineFault SILENT, GONE, RESTARTED, or GARBLED if another program writes too.
        """
        given = [values] if isinstance(values, int) else values
        words = np.array([value % _WORD for value in given], ">u4").tobytes()
        check_address(address, 1 if fixed else len(given))
        if self._has_numbers():
            self.write_words(address, words, fixed=fixed)
            return
        step = 4 * (1 if fixed else max(1, self.words_at_once - WRITE_OVERHEAD))
        for at in range(0, len(words), step):
            place = address if fixed else address + at
            self._plain_write(place, words[at : at + step], repeat=not fixed)

    def write_words(self, address: int, words: bytes, *, fixed: bool = False) -> None:
        """Writes words by numbered writes; see `write_blocks`.

        Args:
            address: address of the first word, bytes.
            words: big-endian.
            fixed: whether all are written to the same address.
        """
        size = 4 * self.words_at_once - 4 * WRITE_OVERHEAD
        step = 0 if fixed else 1
        self.write_blocks(
            [
                ((address + step * at) | fixed, words[at : at + size])
                for at in range(0, len(words), size)
            ]
        )

    def write_blocks(self, blocks: Sequence[tuple[int, bytes]]) -> None:
        """Performs numbered writes, with many packets in flight.

        Args:
            blocks: (byte address, words big-endian) of each; bit 0 of the address: all words go to
                this address. Each has at most `words_at_once` - 5 words.

        Raises LineFault as `write`.
        """
        first = self._number
        if first is None:
            first = int(self.read_words(WRITE_MEM, 1)[0])
        self._number = None  # unknown until all are confirmed
        self._write_in_order(
            [
                np.array([(first + n) % _WORD, address, len(words) // 4], ">u4").tobytes() + words
                for n, (address, words) in enumerate(blocks)
            ],
            first,
        )
        self._number = (first + len(blocks)) % _WORD

    def other_answer(
        self, address: int, got: list[int], right: list[int], *, counted: bool = False
    ) -> None:
        """Does nothing: checksums have verified every answer that arrives."""

    def resynchronise(self) -> int:
        """Does nothing: a packet is complete or does not arrive. Returns 0."""
        return 0

    def pause(self, seconds: float) -> None:
        """Waits. Late answers that arrive meanwhile are counted."""
        self.exchange.listen(seconds)

    def read_blocks(self, blocks: Sequence[bytes]) -> list[bytes]:
        """Reads words with many requests in flight, each block by one packet.

        Args:
            blocks: byte addresses (big-endian) of at most `words_at_once` words each.

        Returns:
            The words of each block, big-endian. Raises LineFault SILENT or GONE.
        """
        exchange = self.exchange
        exchange.begin()
        parts: list[bytes | None] = [None] * len(blocks)
        todo, missing = deque(range(len(blocks))), len(blocks)
        while missing:
            while todo and exchange.flying < max(1, int(exchange.window)):
                key = todo.popleft()
                if parts[key] is None:
                    exchange.send(key, partial(record_packet, reads=blocks[key]))
            answer = exchange.receive()
            if answer is not None:
                key, data = answer[0].key, answer[1]
                if parts[key] is None and len(data) == len(blocks[key]):
                    parts[key] = data
                    missing -= 1
            todo.extendleft(sent.key for sent in reversed(exchange.overdue()))
        return [part for part in parts if part is not None]

    def _write_in_order(self, packets: list[bytes], first: int) -> None:
        """Sends numbered writes until the board has passed the last number."""
        exchange = self.exchange
        exchange.begin()
        done = begun = most = 0  # confirmed; next to send; sent at least once
        current = exchange.order  # transmission from which on a loss or refusal is a new one
        back = WRITE_MEM.to_bytes(4, "big")
        while done < len(packets):
            while begun < len(packets) and exchange.flying < max(1, int(exchange.window)):
                packet = partial(
                    record_packet, reads=back, write_address=WRITE_MEM, written=packets[begun]
                )
                exchange.send(begun, packet)
                begun += 1
                most = max(most, begun)
            answer = exchange.receive()
            failed = exchange.overdue()
            if answer is not None and len(answer[1]) == 4:
                passed = (int.from_bytes(answer[1], "big") - first) % _WORD
                if passed > most:
                    raise self._other_number(passed)
                done = max(done, passed)
                failed.append(answer[0])  # refused, unless its number has been passed
            if any(sent.key >= done and sent.order >= current for sent in failed):
                begun, current = done, exchange.order
            begun = max(begun, done)

    def _other_number(self, passed: int) -> LineFault:
        if passed > _WORD // 2:
            return LineFault(
                Cause.RESTARTED,
                f"the board at {self.port.name} restarted: its number of writes fell",
            )
        return LineFault(
            Cause.GARBLED,
            f"the board at {self.port.name} has performed writes that are not from here",
            "end the other program that writes to it",
        )

    def _plain_write(self, address: int, words: bytes, *, repeat: bool) -> None:
        back = address.to_bytes(4, "big")
        packet = partial(record_packet, reads=back, write_address=address, written=words)
        self.exchange.begin()
        self.exchange.send(0, packet)
        while self.exchange.receive() is None:
            if self.exchange.overdue():
                if not repeat:
                    raise self._unanswered("write")
                self.exchange.send(0, packet)

    def _once(self, block: bytes) -> bytes:
        """Reads a block of addresses by one packet that is not repeated."""
        exchange = self.exchange
        exchange.begin()
        exchange.send(0, partial(record_packet, reads=block))
        end = self.port.now() + self.patience_s
        while self.port.now() < end:
            answer = exchange.receive()
            if answer is not None and len(answer[1]) == len(block):
                return answer[1]
        exchange.overdue()
        raise self._unanswered("read")

    def _unanswered(self, what: str) -> LineFault:
        return LineFault(
            Cause.SHORT, f"a {what} that must not be repeated has no answer from {self.port.name}",
            "a packet was lost: check cable, switch and the board's link",
        )  # fmt: skip

    def _shorten(self, every: bytes, size: int) -> bool:
        """Halves `words_at_once` if a short packet is answered; returns whether it did."""
        size = min(size, len(every)) // 4
        short = partial(record_packet, reads=every[:4])
        if size <= _LEAST_WORDS or not is_answered(self.exchange, short):
            return False
        self.words_at_once = max(_LEAST_WORDS, size // 2)
        return True

    def _has_numbers(self) -> bool:
        """Whether the board has `write_mem`: a Viform board whose map is 1.1 or later."""
        if self._numbered is None:
            magic, _, version = self.read(0, 3)
            same = version >> 16 == VERSION >> 16 and version & 0xFFFF >= 1
            self._numbered = magic == MAGIC and same
        return self._numbered


def _places(address: int, words: int, fixed: bool) -> Words:
    """The byte address of each word, (words,) big-endian uint32."""
    step = 0 if fixed else 4
    return (address + step * np.arange(words, dtype=np.int64)).astype(">u4")
