"""The stage behind a latched chip: row scan, buffer and link, and what the host gets."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np
import numpy.typing as npt

from cosim.compute.opencl import Device
from cosim.files.raw_layout import BLOCK_BYTES, RAW_SIZE
from cosim.files.whole import whole
from cosim.spikes.viform import WORD, Viform, Words, words_for
from cosim.stage import Block, State, section
from rtl_model.readout.buffer import ROW_BYTES, Kept, RowBuffer
from rtl_model.readout.host_file import HostFile
from rtl_model.readout.reference import read_in_numpy
from rtl_model.readout.scan import Readout

RAW: Final = "readout.raw"
"""The bytes that the host gets, in the folder of a run."""
LOST: Final = "readout.npz"
"""Lost rows and fill of the buffer by cycle, in the folder of a run."""
Bytes = npt.NDArray[np.uint8]


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
        with whole(self._folder / LOST) as part, part.open("wb") as file:
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
