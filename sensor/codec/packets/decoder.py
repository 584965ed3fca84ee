"""A stream's packets to words, block by block, with word of what is missing."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from cosim.compute.stopping import threads
from cosim.spikes.ancillary import Ancillary, from_arrays, to_arrays
from cosim.spikes.viform import WORD, Words, words_for
from cosim.stage import State, section
from sensor.codec.coding import workers
from sensor.codec.columns import Damaged
from sensor.codec.packets.ancillary import CODES, AncillaryDecoder
from sensor.codec.packets.catalogue import StreamCode
from sensor.codec.packets.fill import steady
from sensor.codec.packets.packet import Packet, Tiles

Mask = npt.NDArray[np.bool_]
Offsets = npt.NDArray[np.int64]
COUNTERS = ("taken", "refused", "late", "damaged", "held", "missing")


def _put_words(words: Words, first: int, out: Words) -> None:
    """Sets bits of `out` from cycle `first` on, (n, h, w), to those of words; they were 0."""
    at, shift = divmod(first, WORD)
    if not shift:
        out[at : at + len(words)] |= words
        return
    out[at : at + len(words)] |= words << np.uint32(shift)
    above = out[at + 1 : at + 1 + len(words)]
    above |= words[: len(above)] >> np.uint32(WORD - shift)


@dataclass(frozen=True)
class Decoded:
    """Words of some cycles.

    Attributes:
        words: (n, H, W) uint32.
        first, cycles: first cycle and number of cycles.
        held: (rows, columns) of tiles; whether a tile's spikes are, in any of these cycles, those
            of the rate that it had last.
        missing: the same of tiles that were never received, whose bits are 0.
        ancillary: what the source says beyond the spikes in these cycles.
    """

    words: Words
    first: int
    cycles: int
    held: Mask
    missing: Mask
    ancillary: tuple[Ancillary, ...] = ()


class StreamDecoder:
    """Decodes a stream from cycle `start` on, 0 or, without phases, the first of a group.

    It takes any bytes, and never waits: what has not come by the time that it is read counts as
    lost. offsets: as in `StreamEncoder`. length: cycles of the stream; if None, that of its last
    groups is that of their longest packet.
    """

    def __init__(
        self, code: StreamCode, shape: tuple[int, int], start: int = 0,
        offsets: Offsets | None = None, length: int | None = None,
    ) -> None:  # fmt: skip
        self._code, self._tiles, self._maker = code, Tiles(shape, code.tile), code.make()
        self._end = length
        self._offsets = code.offsets(shape) if offsets is None else offsets
        if start % code.cycles or (start and self._offsets.any()):
            raise ValueError(f"start must be a multiple of {code.cycles} cycles, not {start}")
        self._at = start
        self._next = np.full(len(self._tiles), start, np.int64)
        self._packets: dict[tuple[int, int], dict[tuple[int, int], Packet]] = {}
        self._rate: npt.NDArray[np.int32] = np.zeros(shape, np.int32)
        self._over: npt.NDArray[np.int32] = np.zeros(len(self._tiles), np.int32)
        self._words: Words = np.zeros((0, *shape), np.uint32)
        self._lost = np.zeros((2, len(self._tiles)), bool)
        self._last = np.zeros((2, len(self._tiles)), bool)
        self._counts = dict.fromkeys(COUNTERS, 0)
        self._ancillary = AncillaryDecoder(self._tiles)

    @property
    def statistics(self) -> dict[str, int]:
        """Packets taken, refused (they are none of this stream), late (after their cycles were
        decoded) and damaged (the checksum holds, the data cannot be); tiles held and missing, once
        for each group."""
        return dict(self._counts)

    def take(self, data: bytes) -> bool:
        """Takes a packet; whether it is of use."""
        try:
            packet = Packet.of(data)
        except Damaged:
            self._counts["refused"] += 1
            return False
        if packet.code in CODES:
            return self._take_ancillary(packet)
        offset = int(self._offsets[packet.tile]) if packet.tile < len(self._tiles) else 0
        if (
            packet.code != self._code.number
            or packet.layer >= self._maker.layers
            or packet.tile >= len(self._tiles)
            or (packet.first and (packet.first - offset) % self._code.cycles)
            or packet.first + packet.cycles > self._code.end(packet.first, offset)
        ):
            self._counts["refused"] += 1
            return False
        if packet.first < self._next[packet.tile]:
            self._counts["late"] += 1
            return False
        group = self._packets.setdefault((packet.first, offset), {})
        group[packet.tile, packet.layer] = packet
        self._counts["taken"] += 1
        return True

    def _take_ancillary(self, packet: Packet) -> bool:
        """`take` of ancillary data, whose groups all tiles have in common."""
        group, what = self._code.cycles, "refused"
        if packet.first % group == 0 and packet.cycles <= group:
            if packet.first < self._at:
                what = "late"
            elif self._ancillary.take(packet):
                what = "taken"
        self._counts[what] += 1
        return what == "taken"

    def decode(self, until_cycle: int) -> None:
        """Decodes the groups that begin before a cycle; packets of theirs that come later are
        late."""
        while (self._next < until_cycle).any():
            first = int(self._next.min())
            for offset in np.unique(self._offsets[self._next == first]):
                self._decode(first, int(offset))

    def read(self, until_cycle: int) -> Decoded:
        """The cycles from where the last one ended up to `until_cycle` (excluded).

        until_cycle: a multiple of 32, or the end of the stream. Raises ValueError for an earlier
        one, and after the end.
        """
        first = self._at
        if until_cycle < first or first % WORD:
            raise ValueError(f"cycles must be read from {first} on, in whole words")
        self.decode(until_cycle)
        count = words_for(until_cycle - first)
        words, self._words = self._words[:count], self._words[count:]
        if until_cycle % WORD and count:
            words[-1] &= np.uint32((1 << until_cycle % WORD) - 1)
        held, missing = self._lost.reshape(2, *self._tiles.grid)
        self._lost, self._at = self._last & (self._next > until_cycle), until_cycle
        said = self._ancillary.read(first, until_cycle)
        return Decoded(words, first, until_cycle - first, held, missing, said)

    def _decode(self, first: int, offset: int) -> None:
        """Decodes the group of an offset at a cycle with what is there, and forgets its packets."""
        packets, length = (
            self._packets.pop((first, offset), {}),
            self._code.end(first, offset) - first,
        )
        cycles = max((p.cycles for p in packets.values()), default=length)
        if self._end is not None:
            cycles = min(length, self._end - first)
        more = words_for(first + length - self._at) - len(self._words)
        if more > 0:
            spare = np.zeros((more, *self._tiles.shape), np.uint32)
            self._words = np.concatenate([self._words, spare]) if len(self._words) else spare

        def draw(tile: int) -> tuple[bool, bool, int]:
            layers = []
            for layer in range(self._maker.layers):
                packet = packets.get((tile, layer))
                if packet is None or packet.cycles != cycles:
                    break
                layers.append(packet.data)
            rows, columns = self._tiles.place(tile)
            place, damaged = self._words[:, rows, columns], 0
            while layers:
                try:
                    words = self._maker.decode(layers, self._tiles.size(tile), cycles)
                except Damaged:
                    layers.pop()
                    damaged += 1
                    continue
                _put_words(words, first - self._at, place)
                self._rate[rows, columns] = np.bitwise_count(words).sum(axis=0, dtype=np.int32)
                self._over[tile] = cycles
                return False, False, damaged
            if not self._over[tile]:
                return False, True, damaged
            words = steady(self._rate[rows, columns], int(self._over[tile]), cycles)
            _put_words(words, first - self._at, place)
            return True, False, damaged

        tiles = np.flatnonzero((self._offsets == offset) & (self._next == first))
        with threads(workers()) as pool:
            drawn = list(pool.map(draw, map(int, tiles)))
        self._last[:, tiles] = np.array([lost[:2] for lost in drawn]).T
        self._lost[:, tiles] |= self._last[:, tiles]
        self._next[tiles] = first + length
        held, missing = self._last[:, tiles].sum(axis=1)
        self._counts["held"] += int(held)
        self._counts["missing"] += int(missing)
        self._counts["damaged"] += sum(damaged for _, _, damaged in drawn)

    def state(self) -> State:
        """Packets that wait, what was decoded and not read, and the last rates."""
        every = [p for group in self._packets.values() for p in group.values()]
        waiting = [p.to_bytes() for p in [*every, *self._ancillary.waiting]]
        known = {f"known/{k}": v for k, v in to_arrays(self._ancillary.known).items()}
        return {
            "at": np.array([self._at], np.int64),
            "next": self._next.copy(),
            "packets": np.frombuffer(b"".join(waiting), np.uint8).copy(),
            "lengths": np.array([len(data) for data in waiting], np.int64),
            "rate": self._rate.copy(),
            "over": self._over.copy(),
            "words": self._words.copy(),
            "lost": self._lost.copy(),
            "last": self._last.copy(),
            "counts": np.array([self._counts[name] for name in COUNTERS], np.int64),
            **known,
        }

    def restore(self, state: State) -> None:
        """Goes on from a state."""
        (self._at,) = (int(n) for n in state["at"])
        self._packets = {}
        data, place, said = state["packets"].tobytes(), 0, []
        for length in state["lengths"]:
            packet = Packet.of(data[place : place + int(length)])
            if packet.code in CODES:
                said.append(packet)
            else:
                group = packet.first, int(self._offsets[packet.tile])
                self._packets.setdefault(group, {})[packet.tile, packet.layer] = packet
            place += int(length)
        self._ancillary.restore(said, from_arrays(section(state, "known")))
        names = "next", "rate", "over", "words", "lost", "last"
        parts: Any = (state[name].copy() for name in names)
        self._next, self._rate, self._over, self._words, self._lost, self._last = parts
        self._counts = {n: int(v) for n, v in zip(COUNTERS, state["counts"], strict=True)}
