"""A stream's words to packets, block by block."""

from __future__ import annotations

import numpy as np

from cosim.compute.stopping import threads
from cosim.spikes.viform import WORD, Words, spikes_beyond, words_for
from cosim.stage import State
from sensor.codec.coding import workers
from sensor.codec.packets.catalogue import StreamCode
from sensor.codec.packets.packet import Packet
from sensor.codec.packets.part import Layer
from sensor.codec.packets.tiles import Tiles


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
