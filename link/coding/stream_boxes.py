"""The two ends of a stream of packets: frames that are made as the panel needs them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt

from cosim.compute.opencl import Device
from link.coding.blocks import Blocks
from link.coding.kinds import blocks_of
from link.coding.reader import BlockReader, Bytes
from link.coding.stream_frames import (
    PacketRow,
    StreamFrame,
    in_row,
    read_stream_frame,
    room_in,
    write_stream_frame,
)
from link.coding.writer import BlockWriter
from link.layout import PERIOD, Layout

_KEPT: Final = 8
"""Number of blocks whose bytes are stored: a run that resumes shows the last ones again."""
State = dict[str, npt.NDArray[Any]]


def stream_blocks(layout: Layout, interleave: bool = True) -> Blocks:
    """Blocks of a stream. Their keystream has the period of the pilots."""
    return blocks_of(layout, interleave, PERIOD // layout.group)


def stream_rate(form: Blocks) -> int:
    """Bytes of packets, with their lengths, that a block carries."""
    return form.frames * room_in(form.frame_bytes)


class StreamOutbox(BlockWriter):
    """Packets in frames; see `BlockWriter`. Blocks are made in order, each when it is first shown.
    A block for which no packet is ready carries empty frames.

    Args:
        form: form of `stream_blocks`.
        blocks: number of blocks.
        ready: returns the next packet that is ready for a block, None if there is none.
    """

    def __init__(self, form: Blocks, blocks: int, ready: Callable[[int], bytes | None]) -> None:
        super().__init__(form, blocks)
        self._ready = ready
        self._rest = b""
        self._next = 0
        self._rows: dict[int, tuple[bytes, int]] = {}

    def _frames(self, block: int) -> Sequence[Bytes]:
        form = self._blocks
        if block >= self._next:
            if block != self._next:
                raise ValueError(f"block must be {self._next}, not {block}: a stream has an order")
            self._rows[block] = self._fill(block)
            self._rows.pop(block - _KEPT, None)
            self._next += 1
        row, begin = self._rows[block]
        room, number = room_in(form.frame_bytes), block * form.frames
        frames = []
        for n in range(form.frames):
            piece = row[n * room : (n + 1) * room]
            start = self._begins(row, begin, n * room, n * room + len(piece))
            frames.append(
                write_stream_frame(StreamFrame(number + n, piece, start), form.frame_bytes)
            )
        return frames

    def _fill(self, block: int) -> tuple[bytes, int]:
        """Bytes of a block, and the place of the first packet that begins in them."""
        size = stream_rate(self._blocks)
        parts, held = [self._rest], len(self._rest)
        begin = held
        while held < size:
            packet = self._ready(block)
            if packet is None:
                break
            parts.append(in_row(packet))
            held += len(parts[-1])
        row = b"".join(parts)
        self._rest = row[size:]
        return row[:size], begin

    @staticmethod
    def _begins(row: bytes, begin: int, low: int, high: int) -> int | None:
        """Place within row[low:high] of the first packet that begins there."""
        while begin < low:
            if begin + 4 > len(row):
                return None
            begin += 4 + int.from_bytes(row[begin : begin + 4], "little")
        return begin - low if begin < high else None

    @property
    def waiting(self) -> int:
        """Bytes of the packet that the last block has begun and not ended."""
        return len(self._rest)

    def state(self) -> State:
        """What the next blocks depend on, as arrays."""
        state = {
            "next": np.array([self._next]),
            "rest": np.frombuffer(self._rest, np.uint8),
        }
        for block, (row, begin) in self._rows.items():
            state[f"row/{block}"] = np.frombuffer(row, np.uint8)
            state[f"begin/{block}"] = np.array([begin])
        return state

    def restore(self, state: State) -> None:
        """Continues from a `state`."""
        self._next, self._rest = int(state["next"][0]), state["rest"].tobytes()
        self._rows = {
            int(name.removeprefix("row/")): (
                row.tobytes(), int(state[name.replace("row", "begin")][0])
            )
            for name, row in state.items() if name.startswith("row/")
        }  # fmt: skip
        self._cache.clear()


class Arrival(NamedTuple):
    """A packet that arrived.

    Attributes:
        group: group of the transmission that completed it.
        packet: its bytes.
    """

    group: int
    packet: bytes


class StreamInbox(BlockReader):
    """Decodes groups to packets; see `BlockReader`.

    Attributes:
        arrivals: packets in the order of their arrival; the user removes them.
    """

    def __init__(
        self, layout: Layout, *, interleave: bool = True, device: Device | None = None
    ) -> None:
        super().__init__(stream_blocks(layout, interleave), device)
        self._row = PacketRow()
        self.arrivals: list[Arrival] = []

    @property
    def frames_lost(self) -> int:
        """Frames that did not arrive between two that did."""
        return self._row.lost

    def _take(self, block: int, frames: Sequence[Bytes | None]) -> list[bool]:
        right = []
        last = (block + 1) * self._blocks.groups - 1
        for data in frames:
            frame = None if data is None else read_stream_frame(data)
            right.append(frame is not None)
            if frame is not None:
                self.arrivals += [Arrival(last, packet) for packet in self._row.put(frame)]
        return right
