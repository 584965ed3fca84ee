"""A stream's words to packets, block by block; whole streams there and back."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import numpy.typing as npt

from cosim import SpikeStream, Viform
from cosim.compute.stopping import threads
from cosim.spikes.viform import WORD, Words, cut_words, spikes_beyond, words_for
from cosim.stage import State
from sensor.codec.coding import workers
from sensor.codec.packets.catalogue import StreamCode
from sensor.codec.packets.decoder import Offsets, StreamDecoder
from sensor.codec.packets.packet import HEADER, LENGTH, Layer, Packet, Tiles


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
            words = cut_words(self._words[:, rows, columns], first - self._first, end - self._first)
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


def group_bits(code: StreamCode, words: Words, cycles: int) -> npt.NDArray[np.float64]:
    """Bits of the packets of each tile, (tiles,), of its group that begins at its offset in words
    (n, H, W) of some cycles, or as late as the group is in them."""
    shape = words.shape[1], words.shape[2]
    tiles, maker, length = Tiles(shape, code.tile), code.make(), min(code.cycles, cycles)

    def size(tile: int, offset: int) -> int:
        rows, columns = tiles.place(tile)
        first = min(offset, cycles - length)
        part = cut_words(words[:, rows, columns], first, first + length)
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
