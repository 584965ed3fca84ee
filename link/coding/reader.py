"""The common half of all receivers: soft values of groups become the words of blocks, and these
frames.

Reed-Solomon words are read from the line code's values, the least certain of them erased; LDPC
words from the soft values of bits.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final, Protocol

import numpy as np
import numpy.typing as npt

from cosim.compute.cores import by_rows
from cosim.compute.opencl import Device
from link.coding.adaptive_blocks import AdaptiveBlocks
from link.coding.blocks import Blocks
from link.coding.packed_file import Delivered
from link.coding.reed_solomon import ReedSolomon
from link.coding.soft_blocks import SoftBlocks, mark_changed
from link.line_codes import decode_line

Flags = npt.NDArray[np.bool_]
Bytes = npt.NDArray[np.uint8]
_ERASED: Final = (0.25, 0.5, 0.75, 1.0)
"""Shares of the parity for which the least certain bytes are erased, in turn, until a word is a
codeword: generalised minimum distance decoding (Forney 1966), with the frame's CRC as check."""
_SAFE: Final = 0.5
"""Largest share of erasures up to which a codeword is accepted alone; beyond it only in a correct
frame."""
_MANY: Final = 0.05
"""Share of bytes with a wrong decision from which wrong decisions are kept: fewer do no harm to a
detector that learns from decisions."""
_KEPT: Final = 8
"""Number of groups whose wrong decisions are kept: more than a receiver decodes at a time."""


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


def _word_reader(form: Blocks, device: Device | None) -> WordReader:
    return LdpcReader(form, device) if isinstance(form, SoftBlocks) else ReedSolomonReader(form)


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
        self, words: Bytes, quality: npt.NDArray[np.float32]
    ) -> tuple[Bytes, Flags, Flags]:
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


class LdpcReader:
    """Reads the words of blocks; see `WordReader`.

    Args:
        form: form of the blocks.
        device: OpenCL device of the decoder; None for the compiled form, with the same bits.
    """

    def __init__(self, form: SoftBlocks, device: Device | None = None) -> None:
        self._form, self._device = form, device
        self._soft = np.zeros((form.groups, form.layout.group, form.layout.cells), np.int8)

    def store(self, group: int, within: int, soft: npt.NDArray[np.float32]) -> None:
        self._form.store(soft, group, self._soft[within])

    def read(self, block: int, missing: Sequence[int]) -> ReadWords:
        self._soft[missing] = 0
        form = self._form
        if isinstance(form, AdaptiveBlocks):
            number = form.read_header(self._soft)
            form = form.at(form.number if number is None else number)
        soft = form.collect(self._soft)
        data, ok, rounds = form.code.decode(soft, device=self._device)
        sent = form.code.encode(data)
        changed = np.empty_like(sent)
        by_rows(mark_changed, len(sent), soft.view(np.uint64), sent, ok, changed)
        count = int(np.count_nonzero(changed))
        return ReadWords(data, ok, ok.copy(), changed, count, int(rounds.sum()), form)
