"""The common half of all senders: frames become the values of cells, group by group, in the blocks
of the mode's code.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import OrderedDict
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from link.coding.adaptive_blocks import AdaptiveBlocks
from link.coding.blocks import Blocks
from link.coding.soft_blocks import SoftBlocks
from link.layout import Layout

_CACHED = 64 << 20
"""Bytes of values that are cached, at least two blocks: sender, check and judge read them."""


class BlockWriter(ABC):
    """Codes frames to groups.

    Args:
        form: form of the blocks.
        blocks: number of blocks.

    Attributes:
        layout: layout of the cells.
        frames: frames sent.
        groups: groups that carry them.
    """

    def __init__(self, form: Blocks, blocks: int) -> None:
        self.layout: Layout = form.layout
        self._blocks = form
        self.frames = blocks * form.frames
        self.groups = blocks * form.groups
        self._cache: OrderedDict[int, npt.NDArray[np.uint8]] = OrderedDict()

    def _form(self, block: int) -> Blocks:
        """Form of a block; all have the same number of groups."""
        return self._blocks

    @abstractmethod
    def _frames(self, block: int) -> Sequence[npt.NDArray[np.uint8]]:
        """Frames of a block, (`Blocks.frame_bytes`,) uint8 each."""

    def values(self, group: int) -> npt.NDArray[np.uint8]:
        """Line code's values of the data cells in a group, (cells,) uint8."""
        if not 0 <= group < self.groups:
            raise ValueError(f"group must be from 0 to {self.groups - 1}, not {group}")
        block, within = divmod(group, self._blocks.groups)
        if block not in self._cache:
            self._cache[block] = self._make(block)
            most = max(_CACHED // max(self._cache[block].nbytes, 1), 2)
            while len(self._cache) > most:
                self._cache.popitem(last=False)
        return self._cache[block][within]

    def _make(self, block: int) -> npt.NDArray[np.uint8]:
        form = self._form(block)
        data = np.zeros((form.words, form.data_bytes), np.uint8)
        framed = data[: form.frames * form.frame_words].reshape(form.frames, form.frame_bytes)
        for row, frame in zip(framed, self._frames(block), strict=True):
            row[:] = frame
        return form.lay(form.code.encode(data), block)


def blocks_of(layout: Layout, interleave: bool = True, period: int | None = None) -> Blocks:
    """Blocks of a layout, by the code of its mode; with a rate for each block, those of the highest
    rate."""
    if layout.mode.adaptive:
        return AdaptiveBlocks(layout, interleave, period)
    kind = Blocks if layout.mode.rate is None else SoftBlocks
    return kind(layout, interleave, period)
