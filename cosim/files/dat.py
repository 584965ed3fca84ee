"""`.dat`, the format of public spike recordings: no header, frames one after another.

A frame is row-major from the bottom row up, one bit a pixel, the least significant bit of a byte
first; 12 500 bytes at 400 x 250. In numpy:
packbits(spikes[:, ::-1].reshape(T, -1), axis=1, bitorder="little"). Programs differ on whether a
frame is padded to whole bytes, so sizes that would need padding are refused. Cameras also write
frames *with head*: 416 x 250, whose columns 400 to 415 are not pixels.

The size of a file comes from --size, from the config.yaml next to it, or from its length. The file
does not contain it, and its content, which depends on the light, does not determine it. Without
--size and config.yaml, the length selects one of the sizes that cameras write:

| bytes a frame | frame | assumed if the length is a multiple |
|---|---|---|
| 12 500 | 400 x 250 | of this and not of 13 000 |
| 13 000 | 416 x 250, with head | of this and not of 12 500 |
| 11 250 | 450 x 200, as SpikeOne is printed | of this and of none of the others |
| 125 000 | 1000 x 1000 | never: such a length is also a multiple of 10 frames of 400 x 250 |

A multiple of both 12 500 and 13 000 (26 or 25 frames, and so on) is refused. A multiple of 125 000
or of 11 250 too is read as the other size, with a note on this possibility. If it were refused,
every 400 x 250 recording of 10, 200 or 500 frames would need a flag; without the note, a wrong
image could go unnoticed.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from cosim.clock import Clock
from cosim.errors import InputError
from cosim.files.atomic import atomic_write
from cosim.files.config_yaml import CONFIG, Config, adjacent_config
from cosim.files.plane_order import DAT_ORDER, PlaneOrder
from cosim.spikes.viform import WORD, SpikeStream, Words, pack_planes, unpack_planes, words_for

Size = tuple[int, int]
"""(width, height) in columns and rows."""
DAT_SIZE = (400, 250)
"""Default width and height of a `.dat`, as in all public recordings."""
HEAD_SIZE = (416, 250)
"""Stored size of a 400 x 250 frame with head. The pixels are the first 400 columns."""
DAT_CLOCK = Clock(40_000)
"""Clock of recordings, which the file does not contain."""
LARGE_SIZE = (1000, 1000)
PRINTED_SIZE = (450, 200)


def open_dat(
    path: Path, size: Size | None = None, config: Config | None = None,
    order: PlaneOrder = DAT_ORDER,
) -> DatStream:  # fmt: skip
    """A `.dat` as a stream. Without `size` and `config`, see the top of this file."""
    if size is not None:
        return DatStream(path, size, order=order)
    known = config or adjacent_config(path)
    if known is None:
        return DatStream(path, *guess_size(path, path.stat().st_size), order=order)
    try:
        return DatStream(path, known.size, order=order)
    except InputError as exc:
        raise InputError(
            exc.what, f"{exc.must}, as its {CONFIG} says", exc.actual, exc.remedy
        ) from exc


def write_dat(stream: SpikeStream, path: Path, head: bool = False) -> None:
    """Writes a stream as `.dat`, which cannot hold its clock and start.

    Args:
        stream: the stream.
        path: the file.
        head: whether 400 x 250 pixels are written as 416 x 250, with zeros in columns 400 to 415.

    Raises:
        InputError: the stream would be read with another size.
    """
    height, width = stream.shape
    if head and (width, height) != DAT_SIZE:
        raise InputError(
            "a stream written with --head", "400x250", f"{width}x{height}", "leave --head out"
        )
    if (width, height) == HEAD_SIZE:
        raise InputError(
            "the size of a .dat frame",
            "another than 416x250, which is read as 400x250 with head",
            "416x250",
            "use .npz or .zarr for this stream",
        )
    check_dat_size(width, height)
    columns = HEAD_SIZE[0] if head else width
    with atomic_write(path) as part, part.open("wb") as file:
        for w in range(words_for(stream.cycles)):
            n = min(WORD, stream.cycles - w * WORD)
            planes = unpack_planes(stream.read_words(w, w + 1)[:, ::-1], 0, n)
            if head:
                planes = np.pad(planes, ((0, 0), (0, 0), (0, columns - width)))
            file.write(np.packbits(planes.reshape(n, -1), axis=1, bitorder="little").tobytes())


class DatStream:
    """A `.dat` file as a spike stream. Frames are read on demand.

    Args:
        path: the file.
        size: stored width and height of the frames; 416 x 250 means 400 x 250 with head.
        notes: information for the user about the interpretation of the file.
        order: order of bits, bytes and rows, if it is not that of a `.dat`.

    Raises:
        InputError: the file does not consist of whole frames.
    """

    def __init__(
        self, path: Path, size: Size = DAT_SIZE, notes: tuple[str, ...] = (),
        order: PlaneOrder = DAT_ORDER,
    ) -> None:  # fmt: skip
        width, height = size
        frame = check_dat_size(width, height)
        order.check(frame)
        length = path.stat().st_size
        if length == 0 or length % frame:
            frames = f", which is {length // frame} frames and {length % frame} bytes over"
            raise InputError(
                f"{path}",
                f"whole frames of {frame} bytes ({width}x{height})",
                f"{length} bytes{frames if length else ''}",
                "give its true size (--size, or sensor.width and sensor.height), "
                "or take a whole file",
            )
        self._frames = np.memmap(path, np.uint8, "r").reshape(-1, frame)
        self._stored, self._order = (height, width), order
        self._shape = pixels_of(size)[::-1]
        self.notes = notes

    @property
    def shape(self) -> tuple[int, int]:
        return self._shape

    @property
    def cycles(self) -> int:
        return len(self._frames)

    @property
    def clock(self) -> Clock:
        return DAT_CLOCK

    def read_words(self, first: int, stop: int) -> Words:
        stop = min(stop, words_for(self.cycles))
        words = np.empty((max(stop - first, 0), *self._shape), np.uint32)
        for n in range(len(words)):  # a word at a time: unpacked bits need 8 times the memory
            w = first + n
            frames = self._frames[w * WORD : (w + 1) * WORD]
            words[n] = pack_planes(self._order.planes(frames, self._stored, self._shape[1]))[0]
        return words


def check_dat_size(width: int, height: int) -> int:
    """Bytes of a frame. Raises InputError for a size that is not whole bytes."""
    if width < 1 or height < 1 or width * height % 8:
        raise InputError(
            "the size of a .dat frame",
            "WIDTHxHEIGHT with a product that is a multiple of 8",
            f"{width}x{height}",
            "use .npz or .zarr for other sizes",
        )
    return width * height // 8


def pixels_of(stored: Size) -> Size:
    """Width and height in pixels of a stored size: 400 x 250 for 416 x 250."""
    return DAT_SIZE if stored == HEAD_SIZE else stored


_DAT, _HEAD, _LARGE, _PRINTED = (
    check_dat_size(*size) for size in (DAT_SIZE, HEAD_SIZE, LARGE_SIZE, PRINTED_SIZE)
)


def guess_size(path: Path, length: int) -> tuple[Size, tuple[str, ...]]:
    """The stored size of a file of `length` bytes, and notes for the user.

    Raises InputError if both 400 x 250 and 416 x 250 fit.
    """
    n = length // _LARGE
    large = f"1000x1000 ({n} frame{'s' if n > 1 else ''})"
    if length and length % _DAT == length % _HEAD == 0:
        fits = [f"400x250 ({length // _DAT} frames)", f"416x250 with head ({length // _HEAD})"]
        fits += [large] if length % _LARGE == 0 else []
        raise InputError(
            f"{path}",
            "of a size that its length tells",
            f"{length} bytes, which fit {' and '.join(fits)}",
            "give --size 400x250, --size 416x250" + (", --size 1000x1000" if fits[2:] else ""),
        )
    printed = f"450x200 ({length // _PRINTED} frames)"
    if length and length % _HEAD == 0:
        note = f"{path} is read as 400x250 with head, which its length says"
        if length % _PRINTED == 0:
            note += f"; it may be {printed}: --size says which"
        return HEAD_SIZE, (note,)
    if length and length % _DAT and length % _PRINTED == 0:
        return PRINTED_SIZE, (f"{path} is read as {printed}, which its length says",)
    others = [large] if length and length % _LARGE == 0 else []
    others += [printed] if length and length % _PRINTED == 0 else []
    if others:
        return DAT_SIZE, (
            f"{path} is read as 400x250 ({length // _DAT} frames); it may be "
            f"{' or '.join(others)}: --size says which",
        )
    return DAT_SIZE, ()
