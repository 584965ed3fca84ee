"""What every stream code does: a tile's words to the bytes of its layers, and back."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from cosim.spikes.viform import Words

MOST_CYCLES = 512
"""Cycles of a packet, at most."""


@dataclass(frozen=True)
class Layer:
    """One layer of a tile.

    Attributes:
        data: its bytes.
        spikes: number of spikes whose time is known from this layer on; a spike is in one layer
            alone.
        gain: the squared error of counts in a window of 41 cycles that it takes away, summed over
            pixels and cycles, estimated.
    """

    data: bytes
    spikes: int
    gain: float


class TileCode(Protocol):
    """A code of one tile during the cycles of one packet, which depends on nothing else."""

    @property
    def layers(self) -> int:
        """Layers that it sends; those after the first may be missing."""
        ...

    def encode(self, words: Words, cycles: int) -> list[Layer]:
        """The layers of (n, h, w) words, whose bits beyond `cycles` are 0."""
        ...

    def decode(self, layers: Sequence[bytes], shape: tuple[int, int], cycles: int) -> Words:
        """(n, h, w) words of the first one or more layers. Raises Damaged for other bytes."""
        ...
