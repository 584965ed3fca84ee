"""The sender's half for files: a file becomes frames."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from link.coding.fountain import pack_file, packets, source_symbols
from link.coding.frames import Frame, write_frame
from link.coding.soft_blocks import blocks_of
from link.coding.writer import BlockWriter
from link.layout import Layout

__all__ = ["Outbox"]

_BEYOND = 2
"""Smallest number of packets beyond the file's own: with them one decoding in a million fails (RFC
6330)."""


class Outbox(BlockWriter):
    """A file in frames; see `BlockWriter`.

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
        form = blocks_of(layout, interleave)
        self._session, packed = pack_file(data, name)
        self._length = len(packed)
        symbol = form.symbol_bytes
        self.frames_needed = source_symbols(self._length, symbol)
        wanted = max(math.ceil(self.frames_needed * (1 + overhead)), self.frames_needed + _BEYOND)
        super().__init__(form, -(-wanted // form.frames))
        self._wanted = wanted
        most = min(int(self.frames / (1 + overhead)), self.frames - _BEYOND)
        self.room = len(data) + most * symbol - self._length
        self._packets = packets(packed, symbol, self.frames)

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

    def _frames(self, block: int) -> Sequence[npt.NDArray[np.uint8]]:
        form = self._blocks
        first = block * form.frames
        return [
            write_frame(Frame(self._session, self._length, packet), form.frame_bytes)
            for packet in self._packets[first : first + form.frames]
        ]
