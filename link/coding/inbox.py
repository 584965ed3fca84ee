"""The receiver's half for files: frames become a file."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from cosim.compute.opencl import Device
from link.coding.fountain import Gathering
from link.coding.frames import Frame, read_frame
from link.coding.kinds import blocks_of
from link.coding.reader import BlockReader, Bytes
from link.layout import Layout

_SESSIONS: Final = 4
"""Largest number of files gathered at the same time; beyond it, the one with the fewest packets is
dropped."""


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
