"""The spikes of patches behind a code whose layers were not all sent."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from cosim.plan.patches import PatchPlane
from cosim.spikes.viform import Words
from sensor.codec.packets.catalogue import StreamCode
from sensor.codec.packets.coder import StreamDecoder, StreamEncoder
from sensor.codec.packets.packet import Tiles

SIDE: Final = 8
"""Side of the tiles in which patches are coded, pixels: it divides that of every code."""


@dataclass(frozen=True, eq=False)
class CutCode:
    """A code, and the layers that a run has sent of each tile.

    Which spikes a decoder draws depends on the number of layers and on the block of 8 x 8 pixels
    alone. So patches can be coded without the rest of their tiles.

    Attributes:
        code: code of the run.
        shape: (height, width) of the stream.
        cut: number of layers sent, by first cycle and tile, where some were left out.
        plane: the patches.
    """

    code: StreamCode
    shape: tuple[int, int]
    cut: Mapping[tuple[int, int], int]
    plane: PatchPlane

    def through(self, words: Words, cycles: int) -> Words:
        """The words of the patches, (words, pixels), as they are decoded."""
        rows, columns = self.plane.rows, self.plane.columns
        split = self.plane.split(words).reshape(len(words), -1, rows, columns)
        parts = [
            self._patch(np.ascontiguousarray(split[:, n]), cycles, tile)
            for n, tile in enumerate(self.plane.tiles)
        ]
        return np.stack(parts, axis=1).reshape(words.shape)

    def _patch(self, words: Words, cycles: int, tile: int) -> Words:
        """One patch, (words, rows, columns). tile: its number on the plane."""
        code, columns = replace(self.code, tile=SIDE), words.shape[2]
        # Dark pixels beside the patch are always sent: they say how long the last group is.
        spare = -columns % SIDE + SIDE
        words = np.pad(words, ((0, 0), (0, 0), (0, spare)))
        shape = words.shape[1], words.shape[2]
        encoder, decoder = StreamEncoder(code, shape), StreamDecoder(code, shape)
        small, large = Tiles(shape, SIDE), Tiles(self.shape, self.code.tile)
        top, _, left, _ = self.plane.grid.box(tile)
        for packet in [*encoder.encode(words, 0, cycles), *encoder.flush()]:
            y, x = (part.start for part in small.place(packet.tile))
            place = (top + y) // large.side * large.grid[1] + (left + x) // large.side
            sent = self.cut.get((packet.first, place), packet.layer + 1)
            if x >= columns or packet.layer < sent:
                decoder.take(packet.to_bytes())
        return decoder.read(cycles).words[:, :, :columns]
