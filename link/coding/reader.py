"""The common half of all receivers: soft values of groups become frames."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Final

import numpy as np
import numpy.typing as npt

from cosim.compute.opencl import Device
from link.coding.blocks import Blocks
from link.coding.fountain import Delivered
from link.coding.ldpc_reader import LdpcReader
from link.coding.reed_solomon_reader import ReedSolomonReader
from link.coding.soft_blocks import SoftBlocks
from link.coding.word_reader import WordReader

Bytes = npt.NDArray[np.uint8]
_MANY: Final = 0.05
"""Share of bytes with a wrong decision from which wrong decisions are kept: fewer do no harm to a
detector that learns from decisions."""
_KEPT: Final = 8
"""Number of groups whose wrong decisions are kept: more than a receiver decodes at a time."""


def _word_reader(form: Blocks, device: Device | None) -> WordReader:
    return LdpcReader(form, device) if isinstance(form, SoftBlocks) else ReedSolomonReader(form)


class BlockReader(ABC):
    """Decodes groups to frames. They may come in any order, and more than once.

    Args:
        form: form of the blocks.
        device: OpenCL device of a decoder that can use one; None for the compiled form.

    Attributes:
        layout: layout of the cells.
        file: the first whole file; None for a reader of other data.
        over: whether the transmission has ended; later blocks are not counted.
        frames_read: frames of the blocks, up to the transmission's end.
        frames_right: number of frames with a correct CRC.
        frames_needed: frames that the data fill; None if unknown.
        codewords: codewords read.
        codewords_wrong: codewords that could not be corrected, or whose frame was wrong all the
            same.
        bytes_corrected: bytes corrected in the others.
        rounds: rounds of decoding in all codewords; 0 for a code without rounds.
        cell_errors: (cells,) int64, bytes corrected by data cell, or bits of a code of bits.
        mended: decisions that a code of bits found wrong, by group, (symbols, cells) uint8, for the
            last groups of blocks that had many of them.
    """

    def __init__(self, form: Blocks, device: Device | None = None) -> None:
        self.layout = form.layout
        self._blocks = form
        self._words = _word_reader(form, device)
        self._open: int | None = None
        self._here: set[int] = set()
        self.file: Delivered | None = None
        self.over = False
        self.frames_read = self.frames_right = 0
        self.codewords = self.codewords_wrong = self.bytes_corrected = self.rounds = 0
        self.mended: dict[int, Bytes] = {}
        self.cell_errors: npt.NDArray[np.int64] = np.zeros(form.layout.cells, np.int64)

    @property
    def frames_needed(self) -> int | None:
        return None

    @abstractmethod
    def _take(self, block: int, frames: Sequence[Bytes | None]) -> list[bool]:
        """Takes the frames of a block, None for one with a lost codeword. Returns which of them are
        correct. Sets `over` if the block does not belong to the transmission any more."""

    def _reads_parts(self) -> bool:
        """Whether a block is read although groups of it are missing."""
        return True

    def put(self, group: int, soft: npt.NDArray[np.float32]) -> int:
        """Adds one group and returns the number of correct frames it completed (0 while its block
        lacks groups).

        Args:
            group: number of the group.
            soft: (symbols, cells), ln P(1) - ln P(0); 0 where nothing was received.
        """
        if group < 0:
            raise ValueError(f"group must be 0 or more, not {group}")
        shape = self.layout.group, self.layout.cells
        if soft.shape != shape:
            raise ValueError(f"soft must be {shape}, not {soft.shape}")
        if self.over:
            return 0
        block, within = divmod(group, self._blocks.groups)
        right = self.flush() if self._open not in (None, block) else 0
        self._open = block
        self._words.store(group, within, soft)
        self._here.add(within)
        return right + (self.flush() if len(self._here) == self._blocks.groups else 0)

    def readable(self, group: int, soft: npt.NDArray[np.float32]) -> int:
        """Number of words of a group that can be read; takes none; 0 where a block has several
        groups, or other groups wait."""
        if self._blocks.groups > 1 or self._here:
            return 0
        self._words.store(group, 0, soft)
        return int(np.count_nonzero(self._words.read(group, []).ok))

    def flush(self) -> int:
        """Reads the open block although groups are missing. Returns the number of correct
        frames."""
        if self._open is None:
            return 0
        missing = [n for n in range(self._blocks.groups) if n not in self._here]
        block, self._open = self._open, None
        self._here.clear()
        if missing and not self._reads_parts():
            return 0
        return self._read(block, missing)

    def mend(self, first: int, decided: npt.NDArray[np.bool_]) -> npt.NDArray[np.bool_]:
        """Decisions from a group on, (symbols, cells), turned over in place where `mended` has them
        as wrong."""
        size = self.layout.group
        for n in range(len(decided) // size):
            wrong = self.mended.get(first + n)
            if wrong is not None:
                decided[n * size : (n + 1) * size] ^= wrong.astype(np.bool_)
        return decided

    def _keep(self, block: int, wrong: Bytes) -> None:
        """Keeps the last groups of a block's wrong decisions, (groups, symbols, cells)."""
        first = block * len(wrong)
        for n, part in list(enumerate(wrong))[-_KEPT:]:
            self.mended[first + n] = part
        for group in sorted(self.mended)[:-_KEPT]:
            del self.mended[group]

    def _read(self, block: int, missing: Sequence[int]) -> int:
        words = self._words.read(block, missing)
        form = words.form or self._blocks
        each = form.frame_words
        used = form.frames * each
        data = words.data[:used].reshape(form.frames, form.frame_bytes)
        whole = np.all(words.ok[:used].reshape(form.frames, each), axis=1)
        right = self._take(
            block, [row if good else None for row, good in zip(data, whole.tolist(), strict=True)]
        )
        if self.over:
            return 0
        judged = words.sound[:used].reshape(form.frames, each)
        judged[whole] = np.array(right)[whole, None]
        self.frames_read += form.frames
        self.frames_right += sum(right)
        self.codewords += form.words
        self.codewords_wrong += int((~words.sound).sum())
        self.bytes_corrected += words.bytes_changed
        self.rounds += words.rounds
        many = words.bytes_changed > _MANY * form.words * form.word_bytes
        if many and isinstance(form, SoftBlocks):
            self._keep(block, form.bits_of(words.changed))
        if words.bytes_changed:
            self.cell_errors += form.cells_of(words.changed)
        return sum(right)
