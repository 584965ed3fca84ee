"""Reading of Reed-Solomon words: the line code's values, the least certain of them erased."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
import numpy.typing as npt

from link.coding.blocks import Blocks
from link.coding.reed_solomon import ReedSolomon
from link.coding.word_reader import Flags, ReadWords
from link.line_codes import decode_line

_Bytes = npt.NDArray[np.uint8]
_ERASED: Final = (0.25, 0.5, 0.75, 1.0)
"""Shares of the parity for which the least certain bytes are erased, in turn, until a word is a
codeword: generalised minimum distance decoding (Forney 1966), with the frame's CRC as check."""
_SAFE: Final = 0.5
"""Largest share of erasures up to which a codeword is accepted alone; beyond it only in a correct
frame."""


class ReedSolomonReader:
    """Reads the words of blocks; see `WordReader`."""

    def __init__(self, form: Blocks) -> None:
        parity = form.layout.mode.parity
        assert parity is not None
        self._form, self._code = form, ReedSolomon(parity)
        self._values = np.zeros((form.groups, form.layout.cells), np.uint8)
        self._quality = np.zeros(self._values.shape, np.float32)

    def store(self, group: int, within: int, soft: npt.NDArray[np.float32]) -> None:
        values, quality = decode_line(self._form.layout.mode.line, soft)
        self._values[within], self._quality[within] = values[0], np.nan_to_num(quality[0], nan=0.0)

    def read(self, block: int, missing: Sequence[int]) -> ReadWords:
        self._quality[missing] = 0
        words, quality = self._form.gather(self._values, self._quality, block)
        corrected, ok, sound = self._correct(words, quality)
        changed = (corrected != words) & sound[:, None]
        data = corrected[:, : self._form.data_bytes]
        return ReadWords(data, ok, sound, changed, int(changed.sum()), 0)

    def _correct(
        self, words: _Bytes, quality: npt.NDArray[np.float32]
    ) -> tuple[_Bytes, Flags, Flags]:
        """Corrected codewords, where there is one, and where it is accepted on its own."""
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
