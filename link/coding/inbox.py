"""The receiver's half: values of groups, with errors, become a file."""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

from link.coding.blocks import Blocks
from link.coding.fountain import Delivered, Gathering
from link.coding.frames import Frame, read_frame
from link.coding.reed_solomon import ReedSolomon
from link.layout import Layout

__all__ = ["Inbox"]

_SESSIONS: Final = 4
"""Largest number of files gathered at the same time; beyond it, the one with the fewest packets is
dropped."""
_ERASED: Final = (0.25, 0.5, 0.75, 1.0)
"""Shares of the parity for which the least certain bytes are erased, in turn, until a word is a
codeword: generalised minimum distance decoding (Forney 1966), with the frame's CRC as check."""
_SAFE: Final = 0.5
"""Largest share of erasures up to which a codeword is accepted alone; beyond it only in a correct
frame."""


class Inbox:
    """Decodes groups. They may come in any order, and more than once.

    Attributes:
        layout: of the cells.
        file: the first whole file, with the CRC of every frame and of the file correct.
        over: whether a block without a correct frame of the file has followed the whole file. The
            transmission has then ended, and later blocks are not counted.
        frames_read: frames of the blocks, up to the transmission's end.
        frames_right: those with a correct CRC.
        codewords: codewords read.
        codewords_wrong: codewords that could not be corrected, or whose frame was wrong all the
            same.
        bytes_corrected: bytes corrected in the others.
        cell_errors: (cells,) int64, bytes corrected by data cell.
    """

    def __init__(self, layout: Layout, *, interleave: bool = True) -> None:
        self.layout = layout
        self._blocks = Blocks(layout, interleave)
        self._code = ReedSolomon(layout.mode.parity)
        self._open: int | None = None
        self._values = np.zeros((self._blocks.groups, layout.cells), np.uint8)
        self._quality = np.zeros(self._values.shape, np.float32)
        self._here: set[int] = set()
        self._sessions: dict[tuple[int, int], Gathering] = {}
        self._needed: int | None = None
        self.file: Delivered | None = None
        self._whole: tuple[int, int] | None = None
        self.over = False
        self.frames_read = self.frames_right = 0
        self.codewords = self.codewords_wrong = self.bytes_corrected = 0
        self.cell_errors: npt.NDArray[np.int64] = np.zeros(layout.cells, np.int64)

    @property
    def frames_needed(self) -> int | None:
        """Frames that the file fills, known from its first correct frame; None before."""
        return self._needed

    @property
    def frames_gathered(self) -> int:
        """Different frames of the most advanced file."""
        return max((len(session) for session in self._sessions.values()), default=0)

    def put(
        self, group: int, values: npt.NDArray[np.uint8], quality: npt.NDArray[np.float32]
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
        """Reads the open block although groups are missing, unless the file is whole.

        Returns the number of correct frames.
        """
        if self._open is None:
            return 0
        missing = [n for n in range(self._blocks.groups) if n not in self._here]
        self._quality[missing] = 0
        block, self._open = self._open, None
        self._here.clear()
        if missing and self._whole is not None:
            return 0
        words, quality = self._blocks.gather(self._values, self._quality, block)
        return self._read(words, quality)

    def _read(self, words: npt.NDArray[np.uint8], quality: npt.NDArray[np.float32]) -> int:
        form = self._blocks
        corrected, ok, sound = self._correct(words, quality)
        used = form.frames * form.frame_words
        data = corrected[:used, : form.data_bytes].reshape(form.frames, form.frame_bytes)
        whole = np.all(ok[:used].reshape(form.frames, form.frame_words), axis=1).tolist()
        right = mine = 0
        before = self._whole
        for n in range(form.frames):
            frame = read_frame(data[n], form.symbol_bytes) if whole[n] else None
            if whole[n]:
                sound[n * form.frame_words : (n + 1) * form.frame_words] = frame is not None
            if frame is not None:
                right += 1
                mine += (frame.session, frame.length) == before
                self._take(frame)
        if before is not None and not mine:
            self.over = True
            return 0
        wrong = (corrected != words) & sound[:, None]
        self.frames_read += form.frames
        self.frames_right += right
        self.codewords += form.words
        self.codewords_wrong += int((~sound).sum())
        self.bytes_corrected += int(wrong.sum())
        if wrong.any():
            self.cell_errors += form.cells_of(wrong)
        return right

    def _correct(
        self, words: npt.NDArray[np.uint8], quality: npt.NDArray[np.float32]
    ) -> tuple[npt.NDArray[np.uint8], npt.NDArray[np.bool_], npt.NDArray[np.bool_]]:
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

    def _take(self, frame: Frame) -> None:
        key = frame.session, frame.length
        if key not in self._sessions:
            if len(self._sessions) >= _SESSIONS:
                del self._sessions[min(self._sessions, key=lambda k: len(self._sessions[k]))]
            self._sessions[key] = Gathering(frame.length, self._blocks.symbol_bytes)
        session = self._sessions[key]
        if self.file is None:
            self._needed = session.needed
            self.file = session.put(frame.packet)
            self._whole = key if self.file is not None else None
