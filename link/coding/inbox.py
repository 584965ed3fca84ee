"""The receiver's half: values of groups, with errors, become a file, or none."""

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
"""Files gathered at the same time; of more, the one with the fewest packets is given up."""
_ERASED: Final = (0.25, 0.5, 0.75, 1.0)
"""Shares of the parity that the least sure bytes are erased for, one after another until a word is
a codeword: generalised minimum distance decoding (Forney 1966), with the frame's CRC as judge."""
_SAFE: Final = 0.5
"""Up to this share of erasures a codeword is believed on its own, beyond only in a right frame."""


class Inbox:
    """Groups come in any order, and more than once if need be."""

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
        """The first file that is whole: every frame's CRC and its own are right."""
        self._whole: tuple[int, int] | None = None
        self.over = False
        """Whether a block came after the whole file that has no right frame of it: what follows is
        no longer its transmission, and nothing of it is counted."""
        self.frames_seen = self.frames_right = 0
        """Frames that blocks had, and those with the right CRC, up to the transmission's end."""
        self.codewords = self.codewords_wrong = self.bytes_corrected = 0
        """Codewords read, those that could not be mended or whose frame was wrong all the same, and
        bytes mended in the others."""
        self.cell_errors: npt.NDArray[np.int64] = np.zeros(layout.cells, np.int64)
        """Bytes mended, by data cell, (cells,)."""

    @property
    def frames_needed(self) -> int | None:
        """Frames that the file fills, once a frame has told."""
        return self._needed

    @property
    def frames_gathered(self) -> int:
        """Different frames of the file that is furthest."""
        return max((len(session) for session in self._sessions.values()), default=0)

    def put(
        self, group: int, values: npt.NDArray[np.uint8], quality: npt.NDArray[np.float32]
    ) -> int:
        """One group as `decode_line` gives it, both (cells,); quality 0 for cells that were not
        seen. Returns how many right frames it brought (0 while its block lacks groups)."""
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
        """Reads the block that is open though groups of it are missing, unless the file is whole.
        Returns right frames."""
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
        mended, ok, sound = self._mend(words, quality)
        used = form.frames * form.frame_words
        data = mended[:used, : form.data_bytes].reshape(form.frames, form.frame_bytes)
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
        wrong = (mended != words) & sound[:, None]
        self.frames_seen += form.frames
        self.frames_right += right
        self.codewords += form.words
        self.codewords_wrong += int((~sound).sum())
        self.bytes_corrected += int(wrong.sum())
        if wrong.any():
            self.cell_errors += form.cells_of(wrong)
        return right

    def _mend(
        self, words: npt.NDArray[np.uint8], quality: npt.NDArray[np.float32]
    ) -> tuple[npt.NDArray[np.uint8], npt.NDArray[np.bool_], npt.NDArray[np.bool_]]:
        """Codewords, where there is one, and where it is believed on its own."""
        mended, ok, _ = self._code.repair(words)
        sound = ok.copy()
        for share in _ERASED:
            left = np.flatnonzero(~ok)
            if not len(left):
                break
            count = int(share * self._code.parity)
            least = np.argpartition(quality[left], count, axis=1)[:, :count]
            erased = np.zeros((len(left), words.shape[1]), np.bool_)
            np.put_along_axis(erased, least, True, axis=1)
            mended[left], ok[left], _ = self._code.repair(words[left], erased)
            if share <= _SAFE:
                sound[left] = ok[left]
        return mended, ok, sound

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
