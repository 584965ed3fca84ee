"""A stream's words to packets, block by block, and back, with word of what is missing."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from cosim import SpikeStream, Viform
from cosim.compute.stopping import threads
from cosim.spikes.ancillary import Ancillary, from_arrays, to_arrays
from cosim.spikes.viform import WORD, Words, spikes_beyond, words_for
from cosim.stage import State, section
from sensor.codec.coding import workers
from sensor.codec.columns import Damaged
from sensor.codec.packets.ancillary import CODES, AncillaryDecoder
from sensor.codec.packets.catalogue import StreamCode
from sensor.codec.packets.fill import steady
from sensor.codec.packets.packet import HEADER, LENGTH, Layer, Packet, Tiles

Mask = npt.NDArray[np.bool_]
Offsets = npt.NDArray[np.int64]
COUNTERS = ("taken", "refused", "late", "damaged", "held", "missing")


class StreamEncoder:
    """Encodes a stream from cycle 0 on; groups of `code.cycles` cycles, each of them complete.

    What it emits does not depend on how the stream was cut into blocks. With phases, the tiles of
    each begin their groups at cycles of their own, and their first group is the rest before.

    Args:
        code: the code.
        shape: (height, width) of the stream.
        offsets: cycle of each tile, (tiles,), at which its second group begins, 0 for a whole first
            one; those of the code's phases if None.
    """

    def __init__(
        self, code: StreamCode, shape: tuple[int, int], offsets: Offsets | None = None
    ) -> None:
        self._code, self._tiles, self._maker = code, Tiles(shape, code.tile), code.make()
        self._offsets = code.offsets(shape) if offsets is None else offsets
        self._words: Words = np.zeros((0, *shape), np.uint32)
        self._first = 0
        self._held = 0

    def encode(self, words: Words, first_cycle: int, cycles: int | None = None) -> list[Packet]:
        """The packets of the groups that a block completes, in the order in which they do.

        Args:
            words: (n, H, W) uint32; bits beyond the block are 0.
            first_cycle: first cycle of the block, where the last one ended.
            cycles: cycles of the block, 32 n unless it is the last one.

        Raises ValueError for a block that is not the next one, or of another shape.
        """
        count = WORD * len(words) if cycles is None else cycles
        done = self._first + self._held
        if first_cycle != done or self._held % WORD:
            raise ValueError(
                f"a block must begin at cycle {done}, not {first_cycle}, after blocks of whole "
                "words"
            )
        if words.shape[1:] != self._tiles.shape or words_for(count) != len(words):
            raise ValueError(f"{count} cycles of {self._tiles.shape} must not be {words.shape}")
        if len(words) and spikes_beyond(words[-1], count):
            raise ValueError("spikes must lie within the block, not beyond")
        packets: list[Packet] = []
        self._words = np.concatenate([self._words, words]) if self._held else words
        self._held += count
        group, now, offsets = self._code.cycles, done + count, np.unique(self._offsets)
        for end in sorted(
            {int(end) for offset in offsets for end in _ends(offset, group, done, now)}
        ):
            tiles = np.flatnonzero((end - self._offsets) % group == 0)
            packets += self._group([(int(tile), max(end - group, 0), end) for tile in tiles])
        self._drop(min(self._begun(int(offset)) for offset in offsets))
        return packets

    def _begun(self, offset: int) -> int:
        """Cycle at which the group of an offset begins that is not complete yet."""
        now = self._first + self._held
        return max((now - offset) // self._code.cycles * self._code.cycles + offset, 0)

    def _drop(self, first: int) -> None:
        """Forgets the words before a cycle."""
        spare = first // WORD - self._first // WORD
        self._words = self._words[spare:].copy()
        self._first, self._held = self._first + spare * WORD, self._held - spare * WORD

    def flush(self) -> list[Packet]:
        """The packets of the last, shorter groups, if there are some."""
        now, begun = self._first + self._held, [self._begun(int(n)) for n in self._offsets]
        packets = self._group([(n, first, now) for n, first in enumerate(begun) if first < now])
        self._words, self._first, self._held = self._words[:0], now, 0
        return packets

    def _group(self, parts: list[tuple[int, int, int]]) -> list[Packet]:
        """Packets of tiles in some cycles, (tile, first, end): layer by layer and, in a layer, tile
        by tile."""

        def code(part: tuple[int, int, int]) -> list[Layer]:
            tile, first, end = part
            rows, columns = self._tiles.place(tile)
            words = cut_words(self._words[:, rows, columns], first - self._first, end - first)
            return self._maker.encode(words, end - first)

        with threads(workers()) as pool:
            made = list(pool.map(code, parts))
        return [
            Packet(
                self._code.number, layer, tile, first, end - first,
                layers[layer].data, layers[layer].spikes, layers[layer].gain,
            )
            for layer in range(self._maker.layers)
            for (tile, first, end), layers in zip(parts, made, strict=True)
        ]  # fmt: skip

    def state(self) -> State:
        """Words of the groups that are not complete, and where they begin."""
        return {"words": self._words, "place": np.array([self._first, self._held], np.int64)}

    def restore(self, state: State) -> None:
        """Goes on from a state."""
        self._words = state["words"].copy()
        self._first, self._held = (int(n) for n in state["place"])


def _ends(offset: int, group: int, done: int, now: int) -> range:
    """Cycles after `done` and up to `now` at which groups end."""
    first = offset or group
    return range(max(first, done + 1 + (offset - done - 1) % group), now + 1, group)


def cut_words(words: Words, first: int, cycles: int) -> Words:
    """(n, h, w) words of some cycles of others, the first of them in the lowest bit."""
    (at, shift), count = divmod(first, WORD), words_for(cycles)
    out = words[at : at + count]
    if shift:
        out, above = out >> np.uint32(shift), words[at + 1 : at + 1 + count]
        out[: len(above)] |= above << np.uint32(WORD - shift)
    if cycles % WORD:
        out = out.copy()
        out[-1] &= np.uint32((1 << cycles % WORD) - 1)
    return out


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


def group_bits(code: StreamCode, words: Words, cycles: int) -> npt.NDArray[np.float64]:
    """Bits of the packets of each tile, (tiles,), of its group that begins at its offset in words
    (n, H, W) of some cycles, or as late as the group is in them."""
    shape = words.shape[1], words.shape[2]
    tiles, maker, length = Tiles(shape, code.tile), code.make(), min(code.cycles, cycles)

    def size(tile: int, offset: int) -> int:
        rows, columns = tiles.place(tile)
        part = cut_words(words[:, rows, columns], min(offset, cycles - length), length)
        return sum(HEADER + LENGTH + len(layer.data) for layer in maker.encode(part, length))

    with threads(workers()) as pool:
        bytes_of = list(pool.map(size, range(len(tiles)), code.offsets(shape).tolist()))
    return 8.0 * np.array(bytes_of)


def to_packets(stream: SpikeStream, code: StreamCode) -> list[Packet]:
    """All packets of a stream."""
    encoder, step, packets = StreamEncoder(code, stream.shape), code.cycles // WORD, []
    total = words_for(stream.cycles)
    for first in range(0, total, step):
        words = stream.read_words(first, min(first + step, total))
        cycles = min(WORD * len(words), stream.cycles - WORD * first)
        packets += encoder.encode(words, WORD * first, cycles)
    return packets + encoder.flush()


def from_packets(packets: Iterable[Packet], stream: SpikeStream, code: StreamCode) -> Viform:
    """What a decoder of some of a stream's packets has."""
    decoder = StreamDecoder(code, stream.shape)
    for packet in packets:
        decoder.take(packet.to_bytes())
    words = np.concatenate(
        [
            decoder.read(min(first + code.cycles, stream.cycles)).words
            for first in range(0, stream.cycles, code.cycles)
        ]
    )
    return Viform(words, stream.cycles, stream.clock, int(getattr(stream, "start", 0)))


def size_of(packets: Iterable[Packet], stream: SpikeStream) -> float:
    """Bits per pixel and cycle, headers included."""
    pixels = stream.shape[0] * stream.shape[1]
    return 8 * sum(packet.size for packet in packets) / (stream.cycles * pixels)
