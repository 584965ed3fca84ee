"""The common half of all receivers: values of groups, with errors, become frames."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Final

import numpy as np
import numpy.typing as npt

from link.coding.blocks import Blocks
from link.coding.fountain import Delivered
from link.coding.reed_solomon import ReedSolomon

__all__ = ["BlockReader"]

Bytes = npt.NDArray[np.uint8]
_ERASED: Final = (0.25, 0.5, 0.75, 1.0)
"""Shares of the parity for which the least certain bytes are erased, in turn, until a word is a
codeword: generalised minimum distance decoding (Forney 1966), with the frame's CRC as check."""
_SAFE: Final = 0.5
"""Largest share of erasures up to which a codeword is accepted alone; beyond it only in a correct
frame."""


class BlockReader(ABC):
    """Decodes groups to frames. They may come in any order, and more than once.

    Attributes:
        layout: of the cells.
        file: the first whole file; None for a reader of other data.
        over: whether the transmission has ended; later blocks are not counted.
        frames_read: frames of the blocks, up to the transmission's end.
        frames_right: those with a correct CRC.
        frames_needed: frames that the data fill; None if unknown.
        codewords: codewords read.
        codewords_wrong: codewords that could not be corrected, or whose frame was wrong all the
            same.
        bytes_corrected: bytes corrected in the others.
        cell_errors: (cells,) int64, bytes corrected by data cell.
    """

    def __init__(self, form: Blocks) -> None:
        self.layout = form.layout
        self._blocks = form
        self._code = ReedSolomon(form.layout.mode.parity)
        self._open: int | None = None
        self._values = np.zeros((form.groups, form.layout.cells), np.uint8)
        self._quality = np.zeros(self._values.shape, np.float32)
        self._here: set[int] = set()
        self.file: Delivered | None = None
        self.over = False
        self.frames_read = self.frames_right = 0
        self.codewords = self.codewords_wrong = self.bytes_corrected = 0
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

    def put(
        self, group: int, values: Bytes, quality: npt.NDArray[np.float32]
    ) -> int:
        """Adds one group and returns the number of correct frames it completed (0 while its block
        lacks groups).

        Args:
            group: number of the group.
            values, quality: (cells,) of `decode_line`; quality 0 for cells that were not received.
        """
        if group < 0:
            raise ValueError(f"group must be 0 or more, not {group}")
        for name, array in (("values", values), ("quality", quality)):
            if array.shape != (self.layout.cells,):
                raise ValueError(f"{name} must be ({self.layout.cells},), not {array.shape}")
        if self.over:
            return 0
        block, within = divmod(group, self._blocks.groups)
        right = self.flush() if self._open not in (None, block) else 0
        self._open = block
        self._values[within], self._quality[within] = values, np.nan_to_num(quality, nan=0.0)
        self._here.add(within)
        return right + (self.flush() if len(self._here) == self._blocks.groups else 0)

    def flush(self) -> int:
        """Reads the open block although groups are missing. Returns the number of correct
        frames."""
        if self._open is None:
            return 0
        missing = [n for n in range(self._blocks.groups) if n not in self._here]
        self._quality[missing] = 0
        block, self._open = self._open, None
        self._here.clear()
        if missing and not self._reads_parts():
            return 0
        words, quality = self._blocks.gather(self._values, self._quality, block)
        return self._read(block, words, quality)

    def _read(self, block: int, words: Bytes, quality: npt.NDArray[np.float32]) -> int:
        form, each = self._blocks, self._blocks.frame_words
        corrected, ok, sound = self._correct(words, quality)
        used = form.frames * each
        data = corrected[:used, : form.data_bytes].reshape(form.frames, form.frame_bytes)
        whole = np.all(ok[:used].reshape(form.frames, each), axis=1)
        right = self._take(
            block, [row if good else None for row, good in zip(data, whole.tolist(), strict=True)]
        )
        if self.over:
            return 0
        judged = sound[:used].reshape(form.frames, each)
        judged[whole] = np.array(right)[whole, None]
        wrong = (corrected != words) & sound[:, None]
        self.frames_read += form.frames
        self.frames_right += sum(right)
        self.codewords += form.words
        self.codewords_wrong += int((~sound).sum())
        self.bytes_corrected += int(wrong.sum())
        if wrong.any():
            self.cell_errors += form.cells_of(wrong)
        return sum(right)

    def _correct(
        self, words: Bytes, quality: npt.NDArray[np.float32]
    ) -> tuple[Bytes, npt.NDArray[np.bool_], npt.NDArray[np.bool_]]:
        """Returns corrected codewords, where there is one, and where it is accepted on its own."""
        corrected, ok, _ = self._code.repair(words)
        sound = ok.copy()
        for share in _ERASED:
            left = np.flatnonzero(~ok)
            if not len(left):
                break
            count = int(share * self._code.parity)
            least = np.argpartition(quality[left], count, axis=1)[:, :count]
            erased = np.zeros((len(left), words.shape[1]), np.bool_)
            np.put_along_axis(erased, least, True, axis=1)
            corrected[left], ok[left], _ = self._code.repair(words[left], erased)
            if share <= _SAFE:
                sound[left] = ok[left]
        return corrected, ok, sound
