"""What decodes the words of a block: from the soft values of its groups to data."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from link.coding.blocks import Blocks

Flags = npt.NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class ReadWords:
    """The words of a block.

    Attributes:
        data: (words, data bytes) uint8.
        ok: (words,) bool, where a word was found.
        sound: (words,) bool, where it is accepted on its own; otherwise only in a correct frame.
        changed: what was corrected, as `Blocks.cells_of` takes it: (words, bytes) bool, or bits.
        bytes_changed: number of bytes corrected in sound words.
        rounds: rounds of decoding in all words, 0 for a code without rounds.
        form: form of the block, where each has its own; else None.
    """

    data: npt.NDArray[np.uint8]
    ok: Flags
    sound: Flags
    changed: npt.NDArray[Any]
    bytes_changed: int
    rounds: int
    form: Blocks | None = None


class WordReader(Protocol):
    """Takes the groups of one block after another, and reads its words."""

    def store(self, group: int, within: int, soft: npt.NDArray[np.float32]) -> None:
        """Takes a group.

        Args:
            group: its number.
            within: its number in the block.
            soft: (symbols, cells) float32, ln P(1) - ln P(0); 0 or NaN where nothing was received.
        """
        ...

    def read(self, block: int, missing: Sequence[int]) -> ReadWords:
        """Reads a block. missing: numbers of the groups that it lacks."""
        ...
