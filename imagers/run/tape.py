"""The frames of a run on disk: the tape while it runs, and the store that remains.

The store is the Zarr group `frames.zarr`, with one chunk per frame.

Arrays: `values` (n, H, W) uint16, DN, padded with zeros below and to the right of smaller frames;
`rows` (n,) int64, filled rows; `begin`, `end` (n, H) int64, exposure of each row, ps; `ready` (n,)
int64, end of readout, ps. Attributes: `bits`; `time`, the unit; `state`, the figures of the
controllers as one list for each name; and `registers`, likewise, what a host reads in each register
once a frame is ready. All but `values` are written at the end of the run.

The tape is a file of all converted pixel values, from which an interrupted run resumes.

A resumed run starts at its beginning. The sequencer and its controllers run again, and the pixel
values are read from the tape, as far as it reaches, instead of being computed. All random numbers
are counter based, so the rest of the run gives the same bits as an uninterrupted run.

Each record ends in a CRC-32 that goes on from that of the record before it. The tape ends before
the first record that does not agree with its own: one that was cut or zero-filled when the machine
stopped, or damaged later. What follows is computed anew.
"""

from __future__ import annotations

import hashlib
import os
import struct
import zlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import IO, Any

import numpy as np
import numpy.typing as npt
import zarr

from cosim import InputError
from cosim.files.atomic import sync
from cosim.frames import Frame
from sensor.frame_pixels import Exposed, PixelModel

FRAMES = "frames.zarr"
_TOGETHER = 1 << 26
"""Bytes of frames that are collected before they are written."""
TAPE = "checkpoint.tape"
_MAGIC = b"viform imager tape 2\n"
_OVER = 15
_LARGEST = 2**20
"""Upper limit of rows and of columns; a record that states more is damaged."""
_HEAD = struct.Struct("<4q")
"""Frame, first row, rows, columns; the values follow, then the checksum."""
_CRC = struct.Struct("<I")
"""CRC-32 of head and values, which begins with that of the record before; 0 before the first."""
_PART = 1 << 20
"""Bytes that are read at once."""


class FrameStore:
    """Writes frames in order, several at once. An existing store is replaced. The frames of an
    interrupted run are recovered from its tape."""

    def __init__(self, path: Path, bits: int) -> None:
        self._path, self._bits = path, bits
        self._group: Any = None
        self._waiting: list[npt.NDArray[np.uint16]] = []
        self._times: list[tuple[npt.NDArray[np.int64], npt.NDArray[np.int64], int]] = []
        self._state: list[dict[str, float]] = []
        self._pad: tuple[int, int] = (0, 0)

    def append(self, frame: Frame) -> None:
        rows, width = frame.values.shape
        self._pad = max(rows, self._pad[0]), max(width, self._pad[1])
        self._waiting.append(frame.values)
        self._times.append((frame.begin, frame.end, frame.ready))
        self._state.append(dict(frame.state))
        if sum(values.nbytes for values in self._waiting) > _TOGETHER:
            self._write()

    def _write(self) -> None:
        count, (rows, width) = len(self._state), self._pad
        if self._group is None:
            self._group = zarr.open_group(self._path, mode="w")
            self._group.create_array(
                "values", shape=(0, rows, width), chunks=(1, rows, width), dtype="uint16"
            )
        values = self._group["values"]
        values.resize((count, rows, width))
        block = np.zeros((len(self._waiting), rows, width), np.uint16)
        for target, frame in zip(block, self._waiting, strict=True):
            target[: frame.shape[0], : frame.shape[1]] = frame
        values[count - len(block) :] = block
        self._waiting = []

    def finish(self, registers: Mapping[str, Sequence[int]]) -> None:
        """Writes the remaining frames, the times, the figures of the controllers, and what the
        registers hold, one value for each frame."""
        if not self._state:
            return
        if self._waiting or self._group is None:
            self._write()
        count, high = len(self._times), self._pad[0]
        rows = np.array([len(begin) for begin, *_ in self._times], np.int64)
        begin, end = np.zeros((2, count, high), np.int64)
        for n, (one, two, _) in enumerate(self._times):
            begin[n, : len(one)], end[n, : len(two)] = one, two
        ready = np.array([each for *_, each in self._times], np.int64)
        named = (("rows", rows), ("begin", begin), ("end", end), ("ready", ready))
        for name, data in named:
            self._group.create_array(name, data=data)
        names = sorted({name for state in self._state for name in state})
        figures = {name: [state.get(name) for state in self._state] for name in names}
        held = {name: [int(value) for value in values] for name, values in registers.items()}
        self._group.attrs.update(
            {"bits": self._bits, "time": "ps", "state": figures, "registers": held}
        )


def read_frame(path: Path, n: int) -> npt.NDArray[np.uint16]:
    """Values of the n-th frame of a store, (rows, W), DN."""
    group: Any = zarr.open_group(path, mode="r")
    return np.asarray(group["values"][n, : int(group["rows"][n])])


class Tape:
    """The file of a tape.

    Attributes:
        remaining: number of records that have not been played.

    Args:
        path: file.
        identity: text that depends on all inputs of the run; the tape of another run is refused.
        resume: whether an existing tape is continued; otherwise it is replaced.
    """

    def __init__(self, path: Path, identity: str, resume: bool) -> None:
        self._path = path
        head = _MAGIC + hashlib.sha256(identity.encode()).digest()
        self.remaining = self._crc = 0
        if resume and path.exists():
            size = self._check(head)
            self._file = path.open("r+b")
            self._file.truncate(size)
        else:
            size, self._file = 0, path.open("w+b")
        if size == 0:
            self._file.write(head)
            self.sync()  # the head of a killed run then tells that the tape is its own
            sync(path.parent)
        self._file.seek(len(head))

    def _check(self, head: bytes) -> int:
        """Size of the head and all sound records, bytes; 0 if the run was killed before it had
        written the head. Raises InputError for the tape of another run."""
        size = self._path.stat().st_size
        with self._path.open("rb") as file:
            found = file.read(len(head))
            if found != head:
                if head.startswith(found.rstrip(b"\0")) and _is_zero(file):
                    return 0
                raise self._refusal("one of another, or damaged")
            at = len(head)
            while at + _HEAD.size <= size:
                first = file.read(_HEAD.size)
                *_, rows, columns = _HEAD.unpack(first)
                next_one = at + _HEAD.size + 2 * rows * columns + _CRC.size
                if not (0 <= rows <= _LARGEST and 0 <= columns <= _LARGEST) or next_one > size:
                    break
                crc, left = zlib.crc32(first, self._crc), 2 * rows * columns
                while left:
                    part = file.read(min(left, _PART))
                    crc, left = zlib.crc32(part, crc), left - len(part)
                if file.read(_CRC.size) != _CRC.pack(crc):
                    break
                at, self._crc, self.remaining = next_one, crc, self.remaining + 1
        return at

    def _refusal(self, actual: str) -> InputError:
        return InputError(
            "the checkpoint", "one of this same scenario", actual,
            f"remove {self._path} to start afresh, or give the run another --out",
        )  # fmt: skip

    def play(self, rows: Exposed) -> npt.NDArray[np.uint16] | None:
        """The values of the next record, (rows, columns); None at the end of the tape."""
        if not self.remaining:
            return None
        self.remaining -= 1
        frame, first, high, wide = _HEAD.unpack(self._file.read(_HEAD.size))
        if (frame, first) != (rows.frame, rows.first):
            raise self._refusal(f"one that is at frame {frame}")
        data = self._file.read(2 * high * wide)
        self._file.seek(_CRC.size, os.SEEK_CUR)
        return np.frombuffer(data, "<u2").reshape(high, wide).astype(np.uint16)

    def record(self, rows: Exposed, values: npt.NDArray[np.uint16]) -> None:
        """Appends values, (rows, columns), that were converted from these rows."""
        head = _HEAD.pack(rows.frame, rows.first, *values.shape)
        data = np.ascontiguousarray(values, "<u2").tobytes()
        self._crc = zlib.crc32(data, zlib.crc32(head, self._crc))
        self._file.write(head + data + _CRC.pack(self._crc))

    def sync(self) -> None:
        """Writes all records to the disk."""
        self._file.flush()
        os.fsync(self._file.fileno())

    def close(self) -> None:
        self._file.close()


def _is_zero(file: IO[bytes]) -> bool:
    """Whether the rest of a file is filled with zeros."""
    return not any(part.strip(b"\0") for part in iter(lambda: file.read(_PART), b""))


class NoTape:
    """A tape that plays and records nothing."""

    def play(self, rows: Exposed) -> None:
        return None

    def record(self, rows: Exposed, values: npt.NDArray[np.uint16]) -> None: ...


class Taped:
    """Pixels whose values are read from a tape as far as it reaches, and recorded after that.

    Args:
        pixels: pixels that compute values; all other attributes are those of the pixels.
        tape: tape that is played, then recorded.
        watch: function that is called with each exposure and the pixels after the conversion.
    """

    def __init__(self, pixels: PixelModel, tape: Tape | NoTape, watch: Any) -> None:
        self.__dict__.update(pixels=pixels, tape=tape, watch=watch)

    def __getattr__(self, name: str) -> Any:
        return getattr(self.__dict__["pixels"], name)

    def __setattr__(self, name: str, value: Any) -> None:
        setattr(self.__dict__["pixels"], name, value)

    def convert(self, rows: Exposed, seed: int, kept: frozenset[str]) -> npt.NDArray[np.uint16]:
        """See `PixelModel`."""
        values = self.tape.play(rows)
        if values is None:
            values = self.pixels.convert(rows, seed, kept)
            self.tape.record(rows, values)
        self.watch(rows, self.pixels)
        return values

    def digitise(
        self, rows: Exposed, seed: int, kept: frozenset[str]
    ) -> tuple[npt.NDArray[np.uint16], npt.NDArray[np.bool_]]:
        """Values, and the output of the saturation comparator, which is stored in the top bit of
        the records."""
        packed = self.tape.play(rows)
        if packed is None:
            values, over = self.pixels.digitise(rows, seed, kept)
            packed = values | (over.astype(np.uint16) << _OVER)
            self.tape.record(rows, packed)
        self.watch(rows, self.pixels)
        mask = np.uint16((1 << _OVER) - 1)
        return packed & mask, (packed >> _OVER).astype(bool)

    def at(self, **changed: Any) -> Taped:
        """The same device with changed settings, on the same tape."""
        return Taped(self.pixels.at(**changed), self.tape, self.watch)
