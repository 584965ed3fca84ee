"""Files as frames: the sender turns a file into frames, and the receiver turns frames into a file.

| bytes | content |
|---|---|
| 2 | magic "Vf" |
| 1 | version |
| 4 | session: CRC-32C of the file's length, name and CRC |
| 4 | length of the fountain's data |
| 4 | number of the packet: source block, symbol (RFC 6330, section 3.2) |
| T | the packet's symbol |
| | zeros, up to whole codewords |
| 4 | CRC-32C of all preceding bytes |

Numbers are little-endian, except the packet's.
"""

from __future__ import annotations

import math
import struct
from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import Final

import numpy as np
import numpy.typing as npt

from cosim.compute.opencl import Device
from link.coding.adaptive_blocks import AdaptiveBlocks
from link.coding.blocks import Blocks
from link.coding.crc import crc32c
from link.coding.fountain import Gathering, Packet, codable, packets, source_blocks, source_symbols
from link.coding.packed_file import pack_file
from link.coding.reader import BlockReader, Bytes
from link.coding.writer import BlockWriter, blocks_of
from link.layout import Layout

_HEAD: Final = struct.Struct("<2sBII")
_CRC: Final = struct.Struct("<I")
_MAGIC, _VERSION = b"Vf", 1
_NUMBER: Final = 4
_BEYOND = 2
"""Smallest number of packets beyond the file's own: with them one decoding in a million fails (RFC
6330)."""
_SESSIONS: Final = 4
"""Largest number of files gathered at the same time; beyond it, the one with the fewest packets is
dropped."""


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


class Inbox(BlockReader):
    """Decodes groups to a file; see `BlockReader`.

    `file` is the first whole file, with the CRC of every frame and of the file correct. The
    transmission is over if a block without a correct frame of the file has followed the whole file.
    """

    def __init__(
        self, layout: Layout, *, interleave: bool = True, device: Device | None = None
    ) -> None:
        super().__init__(blocks_of(layout, interleave), device)
        self._sessions: dict[tuple[int, int], Gathering] = {}
        self._needed: int | None = None
        self._whole: tuple[int, int] | None = None

    @property
    def frames_needed(self) -> int | None:
        """Frames that the file fills, known from its first correct frame; None before."""
        return self._needed

    def _reads_parts(self) -> bool:
        return self._whole is None

    def _take(self, block: int, frames: Sequence[Bytes | None]) -> list[bool]:
        before, mine = self._whole, 0
        right = []
        for data in frames:
            frame = None if data is None else read_frame(data, self._blocks.symbol_bytes)
            right.append(frame is not None)
            if frame is not None:
                mine += (frame.session, frame.length) == before
                self._gather(frame)
        self.over = before is not None and not mine
        return right

    def _gather(self, frame: Frame) -> None:
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


@dataclass(frozen=True)
class Frame:
    """A frame.

    Attributes:
        session: number of the transmission.
        length: bytes of the fountain's data.
        packet: number and symbol.
    """

    session: int
    length: int
    packet: Packet


def write_frame(frame: Frame, size: int) -> npt.NDArray[np.uint8]:
    """A frame as `size` bytes."""
    body = _HEAD.pack(_MAGIC, _VERSION, frame.session, frame.length) + frame.packet
    body = body.ljust(size - _CRC.size, b"\0")
    return np.frombuffer(body + _CRC.pack(crc32c(body)), np.uint8)


def read_frame(data: npt.NDArray[np.uint8], symbol: int) -> Frame | None:
    """Frame in `data`, with a symbol of `symbol` bytes; None unless every part is correct."""
    raw = data.tobytes()
    body, end = raw[: -_CRC.size], raw[-_CRC.size :]
    if not body.startswith(_MAGIC) or _CRC.pack(crc32c(body)) != end:
        return None
    _, version, session, length = _HEAD.unpack_from(body)
    packet = body[_HEAD.size : _HEAD.size + _NUMBER + symbol]
    if version != _VERSION or not codable(length, symbol):
        return None
    if len(packet) != _NUMBER + symbol or packet[0] >= source_blocks(length, symbol):
        return None
    return Frame(session, length, packet)
