"""The stage behind a latched chip: row scan, buffer and link, and the file of bytes that the host
gets, which is written in parts, over the interruptions of a run.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable
from dataclasses import replace
from io import FileIO
from pathlib import Path
from typing import Final

import numpy as np
import numpy.typing as npt

from cosim.compute.opencl import Device
from cosim.files.atomic import atomic_write, put, sync, sync_all
from cosim.files.raw import BLOCK_BYTES, RAW_SIZE
from cosim.spikes.viform import WORD, Viform, Words, words_for
from cosim.stage import Block, State, section
from rtl_model.readout.buffer import ROW_BYTES, Kept, RowBuffer
from rtl_model.readout.scan import Readout, read_in_numpy

Bytes = npt.NDArray[np.uint8]
_PART: Final = 1 << 24
"""Bytes that are checked at a time."""
RAW: Final = "readout.raw"
"""The bytes that the host gets, in the folder of a run."""
LOST: Final = "readout.npz"
"""Lost rows and fill of the buffer by cycle, in the folder of a run."""


class ScanStage:
    """Passes the planes of a chip through its row scan and the buffer of a link; see `Stateful` and
    `WithFiles`.

    The planes go on as the host rebuilds them: a row that was lost, or that is not read, is dark.
    The host is taken to know the cycle of a row, as a frame grabber with time stamps does; the
    marker of a block does not count frames.

    Args:
        buffer: buffer with the timing of the scan, and with it its window.
        cycles: length of the run.
        folder: folder of the run.
        device: OpenCL device of the scan; None for numpy.
        keep: whether the bytes are written.

    Attributes:
        buffer: buffer as above.
        fill: largest fill of the buffer during the scan of each cycle, (cycles,) int64 bytes.
        lost: lost rows of each cycle, (cycles, 125) uint8: bit r % 8 of byte r // 8 is row r.
    """

    def __init__(
        self, buffer: RowBuffer, cycles: int, folder: Path, device: Device | None, keep: bool
    ) -> None:
        self.buffer, self._cycles, self._folder = buffer, cycles, folder
        window = buffer.timing.window
        self._first, self._last = window.rows
        self._rows = window.places[::2] // 2  # in the order of the scan
        self._shut = ~window.open.reshape(-1)
        self._readout = None if device is None or not keep else Readout(device, window)
        self._raw: Bytes | None = None
        self._file = HostFile(folder / RAW) if keep else None
        self.fill = np.zeros(cycles, np.int64)
        self.lost = np.zeros((cycles, RAW_SIZE[1] // 8), np.uint8)

    @property
    def names(self) -> list[str]:
        """Files in the folder of the run, after the last block."""
        return [LOST] if self._file is None else [RAW, LOST]

    def step(self, stream: Viform, block: Block) -> Viform:
        """The planes of one block as the host has them. Raises OSError (full disk)."""
        kept, peak = self.buffer.scan(block.start, block.cycles)
        if self._file is not None:
            raw = self._read(stream.words, block.cycles)
            rows = raw.reshape(block.cycles, -1, ROW_BYTES)
            self._file.write(raw if kept.all() else rows[kept])
        cycles = slice(block.start, block.stop)
        self.fill[cycles] = peak
        if not kept.all():
            gone = np.zeros((block.cycles, RAW_SIZE[1]), np.bool_)
            gone[:, self._rows] = ~kept
            self.lost[cycles] = np.packbits(gone, axis=1, bitorder="little")
        if block.stop == self._cycles:
            self._finish()
        return self._rebuilt(stream, kept)

    def _read(self, words: Words, cycles: int) -> Bytes:
        if self._readout is not None:
            if self._raw is None or len(self._raw) != cycles:  # written before the next block
                self._raw = np.empty((cycles, self._readout.blocks, BLOCK_BYTES), np.uint8)
            return self._readout.read(words, cycles, self._raw)
        window = self.buffer.timing.window
        parts = [
            read_in_numpy(words[n : n + 1], min(WORD, cycles - n * WORD), window)
            for n in range(len(words))
        ]
        return np.concatenate(parts)

    def _rebuilt(self, stream: Viform, kept: Kept) -> Viform:
        """The planes with lost rows and what is not read dark."""
        outside = self._first > 0 or self._last < RAW_SIZE[1] - 1
        if kept.all() and not outside and not self._shut.any():
            return stream
        words = stream.words.copy()
        words[:, : self._first] = words[:, self._last + 1 :] = 0
        words[:, :, self._shut] = 0
        if not kept.all():
            bits = np.zeros((words_for(len(kept)) * WORD, kept.shape[1]), np.uint32)
            bits[: len(kept)] = kept
            places = np.arange(WORD, dtype=np.uint32)[:, None]
            masks = np.bitwise_or.reduce(bits.reshape(-1, WORD, kept.shape[1]) << places, axis=1)
            words[:, self._rows] &= masks[:, :, None]
        return replace(stream, words=words)

    def _finish(self) -> None:
        if self._file is not None:
            self._file.finish()
        with atomic_write(self._folder / LOST) as part, part.open("wb") as file:
            np.savez_compressed(file, lost=self.lost, fill=self.fill)

    def state(self) -> State:
        """The buffer, the fill, the cycles that lost rows and these rows, and the number of bytes
        in the file and their CRC."""
        if self._file is not None:
            self._file.settle()
        written = [0, 0] if self._file is None else [self._file.written, self._file.crc]
        at = np.flatnonzero(self.lost.any(axis=1))  # seldom many, and each takes 125 bytes
        return {
            "fill": self.fill.copy(), "at": at, "lost": self.lost[at], "file": np.array(written),
            **{f"buffer/{name}": value for name, value in self.buffer.state().items()},
        }  # fmt: skip

    def restore(self, state: State) -> None:
        """Continues from a `state`. Raises ValueError for one of another form."""
        if state["fill"].shape != self.fill.shape:
            raise ValueError("the readout has another number of cycles")
        self.fill, self.lost = state["fill"].copy(), np.zeros_like(self.lost)
        self.lost[state["at"]] = state["lost"]
        self.buffer.restore(section(state, "buffer"))
        if self._file is not None:
            written, crc = (int(n) for n in state["file"])
            self._file.resume(written, crc)

    def damage(self, state: State, checked: Callable[[int, int], None]) -> str | None:
        """See `WithFiles`."""
        if self._file is None or "file" not in state:
            return None
        written, crc = (int(n) for n in state["file"])
        return self._file.damage(written, crc, checked)


class HostFile:
    """A file that grows under a temporary name and gets its own name when it is whole.

    It is opened for each part, so that a run that ends early leaves nothing open.

    Args:
        path: path of the whole file.

    Attributes:
        written: bytes so far, also of the run that is resumed.
        crc: CRC-32 of them (ISO-HDLC, as in zlib).
    """

    def __init__(self, path: Path) -> None:
        self._path, self._part = path, path.with_name(f"{path.name}.part")
        self._begun = False
        self.written = self.crc = 0

    def resume(self, written: int, crc: int) -> None:
        """Goes on after `written` bytes, which `damage` has found sound. Nothing is changed before
        the next `write`."""
        self.written, self.crc = written, crc

    def damage(self, written: int, crc: int, checked: Callable[[int, int], None]) -> str | None:
        """What is wrong if the file must begin with `written` bytes of the CRC `crc`; None if it
        does. checked: see `WithFiles`."""
        there, parts, found = self._there(), -(-written // _PART), 0
        size = there.stat().st_size if there.is_file() else 0
        if size < written:
            return f"{there} must have {written} bytes, not {size}"
        if parts:
            with FileIO(there) as file:
                for n in range(parts):
                    found = zlib.crc32(file.read(min(_PART, written - n * _PART)), found)
                    checked(n + 1, parts)
        return None if found == crc else f"{there} must be as the run wrote it, not damaged"

    def _there(self) -> Path:
        """The file as it is: whole, if the run ended after its last block."""
        return self._path if self._path.is_file() and not self._part.is_file() else self._part

    def write(self, data: npt.NDArray[np.uint8]) -> None:
        """Appends a contiguous array. Raises OSError (full disk)."""
        if not self._begun and self._there() != self._part:
            put(self._path, self._part)
        self._begun = True
        with FileIO(self._part, "r+" if self.written else "w") as file:
            file.truncate(self.written)
            file.seek(self.written)
            left = whole = data.reshape(-1).data
            while left:
                left = left[file.write(left) :]
        self.written += data.nbytes
        self.crc = zlib.crc32(whole, self.crc)

    def settle(self) -> None:
        """Waits until the bytes and the name are on the disk."""
        there = self._there()
        if there.is_file():
            sync_all([there, there.parent])

    def finish(self) -> None:
        """Gives the file its name, once its bytes are on the disk."""
        sync(self._part)
        put(self._part, self._path)
