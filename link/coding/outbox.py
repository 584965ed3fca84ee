"""The sender's half for files: a file becomes frames."""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Sequence
from itertools import groupby

import numpy as np
import numpy.typing as npt

from link.coding.adaptive_blocks import AdaptiveBlocks
from link.coding.blocks import Blocks
from link.coding.fountain import pack_file, packets, source_symbols
from link.coding.frames import Frame, write_frame
from link.coding.kinds import blocks_of
from link.coding.writer import BlockWriter
from link.layout import Layout

_BEYOND = 2
"""Smallest number of packets beyond the file's own: with them one decoding in a million fails (RFC
6330)."""


class Outbox(BlockWriter):
    """A file in frames; see `BlockWriter`.

    Args:
        data: bytes of the file, of any length, 0 too.
        name: name that the receiver gives the file.
        layout: layout of the cells.
        interleave: whether codewords are interleaved.
        overhead: frames beyond the file's own, as a share of them; the last block is filled with
            more.
        rates: numbers of the blocks' rates in `link.mode.EVERY_RATE`, for a rate for each block,
            from the first block on; the last one is that of all later blocks too.

    Attributes:
        frames_needed: frames that the file fills; any so many, and rarely one or two more, recover
            it.
        room: bytes of a file of this name that as many blocks carry. The cells send in parallel, so
            a smaller file takes no less time.

    Raises:
        ValueError: for a panel or a file that cannot be sent.
    """

    def __init__(
        self, data: bytes, name: str, layout: Layout, *, interleave: bool = True,
        overhead: float = 0.05, rates: Sequence[int] = (),
    ) -> None:  # fmt: skip
        if not (math.isfinite(overhead) and overhead >= 0):
            raise ValueError(f"overhead must be 0 or more, not {overhead}")
        form = blocks_of(layout, interleave)
        self._session, packed = pack_file(data, name)
        self._length = len(packed)
        symbol = form.symbol_bytes
        self.frames_needed = source_symbols(self._length, symbol)
        wanted = max(math.ceil(self.frames_needed * (1 + overhead)), self.frames_needed + _BEYOND)
        if isinstance(form, AdaptiveBlocks) != bool(rates):
            raise ValueError(
                "rates must be given for a mode with a rate for each block, and for no other"
            )
        self._forms: list[Blocks] = []
        self._ends = [0]
        while self._ends[-1] < wanted:
            if isinstance(form, AdaptiveBlocks):
                form = form.at(rates[min(len(self._forms), len(rates) - 1)])
            self._forms.append(form)
            self._ends.append(self._ends[-1] + form.frames)
        super().__init__(form, len(self._forms))
        self.frames, self._wanted = self._ends[-1], wanted
        most = min(int(self.frames / (1 + overhead)), self.frames - _BEYOND)
        self.room = len(data) + most * symbol - self._length
        self._packets = packets(packed, symbol, self.frames)

    def frames_by(self, groups: int) -> int:
        """Number of frames that the first `groups` groups carry whole."""
        return self._ends[min(groups, self.groups) // self._blocks.groups]

    def words_by(self, groups: int) -> int:
        """Number of words that the first `groups` groups carry whole."""
        blocks = min(groups, self.groups) // self._blocks.groups
        return sum(form.words for form in self._forms[:blocks])

    def groups_for(self, frames: float) -> int | None:
        """Number of groups that carry so many frames whole; None if there are fewer."""
        block = bisect_left(self._ends, frames)
        return block * self._blocks.groups if block < len(self._ends) else None

    @property
    def word_rate(self) -> float:
        """Data bits per bit sent, in the mean of the blocks' codes."""
        if not self.layout.mode.adaptive:
            return self.layout.mode.word_rate
        return sum(rate * blocks for rate, blocks in self.runs) / len(self._forms)

    @property
    def runs(self) -> list[tuple[float, int]]:
        """Rates of the blocks in turn, each with the number of blocks in a row that have it; empty
        for a mode of one code."""
        rates = [form.rate for form in self._forms if isinstance(form, AdaptiveBlocks)]
        return [(rate, len(list(some))) for rate, some in groupby(rates)]

    def _form(self, block: int) -> Blocks:
        return self._forms[block]

    def frames_beyond(self, groups: int) -> tuple[int, int]:
        """Frames beyond the file's own in the first `groups` groups.

        The first number is those sent because of `overhead`, the second those that only fill the
        last block.
        """
        sent = self.frames_by(groups)
        fill = max(sent - self._wanted, 0)
        return max(sent - fill - self.frames_needed, 0), fill

    def _frames(self, block: int) -> Sequence[npt.NDArray[np.uint8]]:
        form, first = self._forms[block], self._ends[block]
        return [
            write_frame(Frame(self._session, self._length, packet), form.frame_bytes)
            for packet in self._packets[first : first + form.frames]
        ]
