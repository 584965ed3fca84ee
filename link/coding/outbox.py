"""The sender's half: a file becomes the values of cells, group by group."""

from __future__ import annotations

import math
from collections import OrderedDict

import numpy as np
import numpy.typing as npt

from link.coding.blocks import Blocks
from link.coding.fountain import pack_file, packets, source_symbols
from link.coding.frames import Frame, write_frame
from link.coding.reed_solomon import WORD_BYTES, ReedSolomon
from link.layout import Layout

__all__ = ["Outbox"]

_BEYOND = 2
"""Smallest number of packets beyond the file's own: with them one decoding in a million fails (RFC
6330)."""
_CACHED = 2
"""Number of blocks whose values are cached."""


class Outbox:
    """A file in frames.

    Args:
        data: of any length, 0 too.
        name: name that the receiver gives the file.
        layout: of the cells.
        interleave: whether codewords are interleaved.
        overhead: frames beyond the file's own, as a share of them; the last block is filled with
            more.

    Attributes:
        frames_needed: frames that the file fills; any so many, and rarely one or two more, recover
            it.
        frames: frames sent.
        groups: groups that carry them.
        room: bytes of a file of this name that as many blocks carry. The cells send in parallel, so
            a smaller file takes no less time.

    Raises:
        ValueError: for a panel or a file that cannot be sent.
    """

    def __init__(
        self, data: bytes, name: str, layout: Layout, *, interleave: bool = True,
        overhead: float = 0.05,
    ) -> None:  # fmt: skip
        if not (math.isfinite(overhead) and overhead >= 0):
            raise ValueError(f"overhead must be 0 or more, not {overhead}")
        self.layout = layout
        self._blocks = Blocks(layout, interleave)
        self._code = ReedSolomon(layout.mode.parity)
        self._session, packed = pack_file(data, name)
        self._length = len(packed)
        symbol = self._blocks.symbol_bytes
        self.frames_needed = source_symbols(self._length, symbol)
        wanted = max(math.ceil(self.frames_needed * (1 + overhead)), self.frames_needed + _BEYOND)
        blocks = -(-wanted // self._blocks.frames)
        self.frames = blocks * self._blocks.frames
        self._wanted = wanted
        self.groups = blocks * self._blocks.groups
        most = min(int(self.frames / (1 + overhead)), self.frames - _BEYOND)
        self.room = len(data) + most * symbol - self._length
        self._packets = packets(packed, symbol, self.frames)
        self._cache: OrderedDict[int, npt.NDArray[np.uint8]] = OrderedDict()

    def frames_by(self, groups: int) -> int:
        """Returns the number of frames that the first `groups` groups carry whole."""
        return min(groups, self.groups) // self._blocks.groups * self._blocks.frames

    def frames_beyond(self, groups: int) -> tuple[int, int]:
        """Returns the frames beyond the file's own in the first `groups` groups.

        The first number is those sent because of `overhead`, the second those that only fill the
        last block.
        """
        sent = self.frames_by(groups)
        fill = max(sent - self._wanted, 0)
        return max(sent - fill - self.frames_needed, 0), fill

    def values(self, group: int) -> npt.NDArray[np.uint8]:
        """Returns the line code's values of the data cells in a group, (cells,) uint8."""
        if not 0 <= group < self.groups:
            raise ValueError(f"group must be from 0 to {self.groups - 1}, not {group}")
        block, within = divmod(group, self._blocks.groups)
        if block not in self._cache:
            self._cache[block] = self._make(block)
            while len(self._cache) > _CACHED:
                self._cache.popitem(last=False)
        return self._cache[block][within]

    def _make(self, block: int) -> npt.NDArray[np.uint8]:
        form = self._blocks
        data = np.zeros((form.words, form.data_bytes), np.uint8)
        framed = data[: form.frames * form.frame_words].reshape(form.frames, form.frame_bytes)
        for n in range(form.frames):
            packet = self._packets[block * form.frames + n]
            framed[n] = write_frame(Frame(self._session, self._length, packet), form.frame_bytes)
        words = self._code.encode(data)
        assert words.shape == (form.words, WORD_BYTES)
        return form.lay(words, block)
