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
from sensor.codec.packets.packet import Layer, Packet, Tiles

Mask = npt.NDArray[np.bool_]
COUNTERS = ("taken", "refused", "late", "damaged", "held", "missing")


class StreamEncoder:
    """Encodes a stream from cycle 0 on; groups of `code.cycles` cycles, each of them complete.

    What it emits does not depend on how the stream was cut into blocks.
    """

    def __init__(self, code: StreamCode, shape: tuple[int, int]) -> None:
        self._code, self._tiles, self._maker = code, Tiles(shape, code.tile), code.make()
        self._words: Words = np.zeros((0, *shape), np.uint32)
        self._first = 0
        self._held = 0

    def encode(self, words: Words, first_cycle: int, cycles: int | None = None) -> list[Packet]:
        """The packets of the groups that a block completes.

        Args:
            words: (n, H, W) uint32; bits beyond the block are 0.
            first_cycle: first cycle of the block, where the last one ended.
            cycles: cycles of the block, 32 n unless it is the last one.

        Raises ValueError for a block that is not the next one, or of another shape.
        """
        count = WORD * len(words) if cycles is None else cycles
        if first_cycle != self._first + self._held or self._held % WORD:
            raise ValueError(
                f"a block must begin at cycle {self._first + self._held}, not {first_cycle}, "
                "after blocks of whole words"
            )
        if words.shape[1:] != self._tiles.shape or words_for(count) != len(words):
            raise ValueError(f"{count} cycles of {self._tiles.shape} must not be {words.shape}")
        if len(words) and spikes_beyond(words[-1], count):
            raise ValueError("spikes must lie within the block, not beyond")
        packets: list[Packet] = []
        held, self._held = self._held, self._held + count
        rest = np.concatenate([self._words, words]) if held else words
        while self._held >= self._code.cycles:
            packets += self._group(rest[: self._code.cycles // WORD], self._code.cycles)
            rest = rest[self._code.cycles // WORD :]
        self._words = rest.copy()
        return packets

    def flush(self) -> list[Packet]:
        """The packets of a last, shorter group, if there is one."""
        if not self._held:
            return []
        packets = self._group(self._words, self._held)
        self._words = self._words[:0]
        return packets

    def _group(self, words: Words, cycles: int) -> list[Packet]:
        """Packets of the next group, layer by layer and, in a layer, tile by tile."""

        def code(tile: int) -> list[Layer]:
            rows, columns = self._tiles.place(tile)
            return self._maker.encode(words[:, rows, columns], cycles)

        with threads(workers()) as pool:
            tiles = list(pool.map(code, range(len(self._tiles))))
        first, self._first, self._held = self._first, self._first + cycles, self._held - cycles
        return [
            Packet(
                self._code.number, layer, tile, first, cycles,
                made[layer].data, made[layer].spikes, made[layer].gain,
            )
            for layer in range(self._maker.layers)
            for tile, made in enumerate(tiles)
        ]  # fmt: skip

    def state(self) -> State:
        """Words of the group that is not complete, and where it begins."""
        return {"words": self._words, "place": np.array([self._first, self._held], np.int64)}

    def restore(self, state: State) -> None:
        """Goes on from a state."""
        self._words = state["words"].copy()
        self._first, self._held = (int(n) for n in state["place"])


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
    """Decodes a stream from cycle `start` on, 0 or the first of a group.

    It takes any bytes, and never waits: what has not come by the time that it is read counts as
    lost.
    """

    def __init__(self, code: StreamCode, shape: tuple[int, int], start: int = 0) -> None:
        self._code, self._tiles, self._maker = code, Tiles(shape, code.tile), code.make()
        if start % code.cycles:
            raise ValueError(f"start must be a multiple of {code.cycles} cycles, not {start}")
        self._at = start
        self._packets: dict[int, dict[tuple[int, int], Packet]] = {}
        self._rate: npt.NDArray[np.int32] = np.zeros(shape, np.int32)
        self._over: npt.NDArray[np.int32] = np.zeros(len(self._tiles), np.int32)
        self._group: Words = np.zeros((0, *shape), np.uint32)
        self._held = np.zeros(self._tiles.grid, bool)
        self._missing = np.zeros(self._tiles.grid, bool)
        self._counts = dict.fromkeys(COUNTERS, 0)
        self._ancillary = AncillaryDecoder(self._tiles)

    @property
    def statistics(self) -> dict[str, int]:
        """Packets taken, refused (they are none of this stream), late (after their cycles were
        read) and damaged (the checksum holds, the data cannot be); tiles held and missing, once
        for each group."""
        return dict(self._counts)

    def take(self, data: bytes) -> bool:
        """Takes a packet; whether it is of use."""
        try:
            packet = Packet.of(data)
        except Damaged:
            self._counts["refused"] += 1
            return False
        group, said = self._code.cycles, packet.code in CODES
        spikes = (
            packet.code == self._code.number
            and packet.layer < self._maker.layers
            and packet.tile < len(self._tiles)
        )
        if not (spikes or said) or packet.first % group or packet.cycles > group:
            self._counts["refused"] += 1
            return False
        begun = packet.first == self._at // group * group and len(self._group) > 0
        if packet.first < self._at or begun:
            self._counts["late"] += 1
            return False
        if said:
            taken = self._ancillary.take(packet)
            self._counts["taken" if taken else "refused"] += 1
            return taken
        self._packets.setdefault(packet.first, {})[packet.tile, packet.layer] = packet
        self._counts["taken"] += 1
        return True

    def read(self, until_cycle: int) -> Decoded:
        """The cycles from where the last one ended up to `until_cycle` (excluded).

        until_cycle: a multiple of 32, or the end of the stream. Raises ValueError for an earlier
        one, and after the end.
        """
        first, group = self._at, self._code.cycles
        if until_cycle < first or first % WORD:
            raise ValueError(f"cycles must be read from {first} on, in whole words")
        words: Words = np.zeros((words_for(until_cycle - first), *self._tiles.shape), np.uint32)
        held, missing = np.zeros(self._tiles.grid, bool), np.zeros(self._tiles.grid, bool)
        while self._at < until_cycle:
            begin = self._at // group * group
            if not len(self._group):
                self._decode(begin)
            stop = min(begin + group, until_cycle)
            part = self._group[(self._at - begin) // WORD : words_for(stop - begin)]
            words[(self._at - first) // WORD :][: len(part)] = part
            held, missing = held | self._held, missing | self._missing
            self._at = stop
            if stop == begin + group:
                self._group = self._group[:0]
        if len(words) and until_cycle % WORD:
            words[-1] &= np.uint32((1 << until_cycle % WORD) - 1)
        said = self._ancillary.read(first, until_cycle)
        return Decoded(words, first, until_cycle - first, held, missing, said)

    def _decode(self, begin: int) -> None:
        """Decodes the group at cycle `begin` with what is there, and forgets its packets."""
        packets = self._packets.pop(begin, {})
        cycles = max((p.cycles for p in packets.values()), default=self._code.cycles)
        group = np.zeros((words_for(self._code.cycles), *self._tiles.shape), np.uint32)

        def draw(tile: int) -> tuple[bool, bool, int]:
            layers = []
            for layer in range(self._maker.layers):
                packet = packets.get((tile, layer))
                if packet is None or packet.cycles != cycles:
                    break
                layers.append(packet.data)
            rows, columns = self._tiles.place(tile)
            place, damaged = group[: words_for(cycles), rows, columns], 0
            while layers:
                try:
                    place[:] = self._maker.decode(layers, self._tiles.size(tile), cycles)
                except Damaged:
                    layers.pop()
                    damaged += 1
                    continue
                self._rate[rows, columns] = np.bitwise_count(place).sum(axis=0, dtype=np.int32)
                self._over[tile] = cycles
                return False, False, damaged
            if not self._over[tile]:
                return False, True, damaged
            place[:] = steady(self._rate[rows, columns], int(self._over[tile]), cycles)
            return True, False, damaged

        with threads(workers()) as pool:
            drawn = list(pool.map(draw, range(len(self._tiles))))
        self._held = np.array([held for held, _, _ in drawn]).reshape(self._tiles.grid)
        self._missing = np.array([lost for _, lost, _ in drawn]).reshape(self._tiles.grid)
        self._counts["held"] += int(self._held.sum())
        self._counts["missing"] += int(self._missing.sum())
        self._counts["damaged"] += sum(damaged for _, _, damaged in drawn)
        self._group = group

    def state(self) -> State:
        """Packets that wait, the group that is being read, and the last rates."""
        every = [p for group in self._packets.values() for p in group.values()]
        waiting = [p.to_bytes() for p in [*every, *self._ancillary.waiting]]
        known = {f"known/{k}": v for k, v in to_arrays(self._ancillary.known).items()}
        return {
            "at": np.array([self._at], np.int64),
            "packets": np.frombuffer(b"".join(waiting), np.uint8).copy(),
            "lengths": np.array([len(data) for data in waiting], np.int64),
            "rate": self._rate.copy(),
            "over": self._over.copy(),
            "group": self._group.copy(),
            "held": self._held.copy(),
            "missing": self._missing.copy(),
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
                self._packets.setdefault(packet.first, {})[packet.tile, packet.layer] = packet
            place += int(length)
        self._ancillary.restore(said, from_arrays(section(state, "known")))
        parts: Any = (state[name].copy() for name in ("rate", "over", "group", "held", "missing"))
        self._rate, self._over, self._group, self._held, self._missing = parts
        self._counts = {n: int(v) for n, v in zip(COUNTERS, state["counts"], strict=True)}


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
