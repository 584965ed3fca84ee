"""Codes of one layer: the words as they are, and the first-spike codes, anew in every packet."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cosim.spikes.viform import Words, spikes_beyond, words_for
from sensor.codec.coding import Code, decode_band, encode_band
from sensor.codec.columns import Damaged
from sensor.codec.packets.packet import Layer


class Raw:
    """Words as they are, one bit a pixel and cycle: 32-bit words, little-endian, of the first 32
    cycles of all pixels, then of the next."""

    layers = 1

    def encode(self, words: Words, cycles: int) -> list[Layer]:
        """As `TileCode.encode`."""
        spikes = int(np.bitwise_count(words).sum(dtype=np.int64))
        return [Layer(words.astype("<u4").tobytes(), spikes, float(spikes))]

    def decode(self, layers: Sequence[bytes], shape: tuple[int, int], cycles: int) -> Words:
        """As `TileCode.decode`."""
        if len(layers[0]) != 4 * words_for(cycles) * shape[0] * shape[1]:
            raise Damaged("raw words of another size")
        words: Words = np.frombuffer(layers[0], "<u4").astype(np.uint32).reshape(-1, *shape)
        if spikes_beyond(words[-1], cycles):
            raise Damaged("spikes beyond the last cycle")
        return words


class FirstSpike:
    """A first-spike code (coding.py), whose pixels begin and end with the packet."""

    layers = 1

    def __init__(self, code: Code) -> None:
        self._code = code

    def encode(self, words: Words, cycles: int) -> list[Layer]:
        """As `TileCode.encode`."""
        spikes = int(np.bitwise_count(words).sum(dtype=np.int64))
        frame = encode_band(self._code, words.reshape(len(words), -1), cycles)
        return [Layer(frame.data, spikes, float(spikes))]

    def decode(self, layers: Sequence[bytes], shape: tuple[int, int], cycles: int) -> Words:
        """As `TileCode.decode`."""
        data = memoryview(layers[0])
        words = decode_band(self._code, [data], shape[0] * shape[1], cycles)
        return words.reshape(-1, *shape)
