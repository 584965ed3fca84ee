"""Zarr: the store of a run, written block by block and read in any part.

The store is a group with the attributes `viform` (format version), `cycles`, `clock`, `start` and
`complete`, and one array `words` (n, H, W) uint32, in chunks of 64 cycles with zstd and checksums.
`complete` becomes true after the last block; readers refuse the store before. Chunks without spikes
are also written, so that a lost chunk is detected. How chunks are compressed is a choice of the run
(`storing`); every reader reads all of them.

The size that a Zstandard frame states of its content is checked before it is unpacked.
"""

from __future__ import annotations

import json
from collections import OrderedDict
from collections.abc import Mapping
from pathlib import Path
from threading import Lock
from typing import Final, cast

import numpy as np

from cosim.clock import Clock
from cosim.compute.memory import check_plane
from cosim.errors import InputError, shorten
from cosim.files.atomic import identity
from cosim.spikes.viform import Words, spikes_beyond, words_for

VERSION = 1
CHUNK = 2
"""Words in a chunk: 64 cycles, a block."""
KEPT = 1 << 26
"""Bytes of decoded chunks that a reader keeps, beside the last one."""
_SUM = 4
"""Bytes of a chunk's checksum without compression."""
_CODECS: Final = {"zstd", "crc32c"}
"""Codecs after the first, which makes bytes of words."""
_MOST: Final = 1 << 20
"""Bytes of an array's description, at most."""
HEAD: Final = 18
"""Bytes of the longest header of a frame (RFC 8878, section 3.1.1)."""
_MAGIC: Final = b"\x28\xb5\x2f\xfd"
_ID: Final = (0, 1, 2, 4)
"""Bytes of the dictionary's number, by the two lowest bits of the descriptor."""


class ZarrStream:
    """A complete store as a spike stream, for any number of threads. The last chunks are kept.
    Raises InputError for others.

    Args:
        written: chunks by number that are in memory already, and are not read from the store.
        unfinished: whether the store may be that of a run that has not come to its end.

    Attributes:
        kept: bytes of decoded chunks that are kept, beside the last one.
    """

    def __init__(
        self, path: Path, written: Mapping[int, Words] | None = None, kept: int = KEPT,
        *, unfinished: bool = False,
    ) -> None:  # fmt: skip
        import zarr  # takes a quarter of a second, so only if a store is opened

        self._opened = identity(form_of(path))
        _check_form(path)
        try:
            group = zarr.open_group(path, mode="r", use_consolidated=False)
            attributes = dict(group.attrs)
            words = group["words"]
            if not isinstance(words, zarr.Array):
                raise TypeError("words must be an array, not a group")
            self.cycles = int(cast(int, attributes["cycles"]))
            num, den = (int(x) for x in cast(list[int], attributes["clock"]))
            self.clock = Clock(num, den)
            self.start = int(cast(int, attributes["start"]))
            version, complete = attributes["viform"], attributes["complete"]
        except Exception as exc:  # zarr raises many types for what is no store
            raise not_a_store(path, "something else") from exc
        if version != VERSION:
            raise not_a_store(
                path, f"format {version}", f"use a program that writes format {VERSION}"
            )
        if complete is not True and not unfinished:
            raise not_a_store(
                path,
                "one that was interrupted",
                f"finish it: viform run {path.parent} --resume --out {path.parent}",
            )
        shape_ok = words.ndim == 3 and words.shape[0] == words_for(self.cycles)
        if words.dtype != np.uint32 or not shape_ok or 0 in words.shape:
            raise not_a_store(path, f"words of shape {words.shape} for {self.cycles} cycles")
        if words.chunks != (CHUNK, *words.shape[1:]):
            raise not_a_store(path, f"chunks of shape {words.chunks}")
        check_plane(f"{path}", (words.shape[1], words.shape[2]))
        self._path, self._words, self._written = path, words, written or {}
        self._kept: OrderedDict[int, Words] = OrderedDict()
        self.kept = kept
        self._lock = Lock()

    @property
    def shape(self) -> tuple[int, int]:
        """(height, width) in pixels."""
        return self._words.shape[1], self._words.shape[2]

    def _chunk(self, n: int) -> Words:
        """Words of chunk n."""
        if n in self._written:
            return self._written[n]
        with self._lock:
            kept = self._kept.get(n)
            if kept is not None:
                self._kept.move_to_end(n)
                return kept
        words = self._decoded(n)
        with self._lock:
            self._kept[n] = words
            while len(self._kept) > 1 + self.kept // words.nbytes:
                self._kept.popitem(last=False)
        return words

    def _decoded(self, n: int) -> Words:
        """Words of chunk n from its file."""
        place = self._chunk_path(n)
        if not place.is_file():
            raise not_a_store(self._path, f"one without chunk {n}", "copy it again, whole")
        if not self._fits(place):
            raise not_a_store(self._path, f"damaged in chunk {n}")
        try:
            words = cast(Words, self._words[n * CHUNK : (n + 1) * CHUNK])
        except Exception as exc:  # a chunk that does not decode
            raise not_a_store(self._path, f"damaged in chunk {n}") from exc
        if identity(form_of(self._path)) != self._opened:  # chunks of two stores are no stream
            raise not_a_store(self._path, "another one than was opened", "open it again")
        last = n * CHUNK + len(words) == words_for(self.cycles)
        if last and spikes_beyond(words[-1], self.cycles):
            raise not_a_store(self._path, "one with spikes beyond its last cycle")
        return words

    def _chunk_path(self, n: int) -> Path:
        """File of chunk n."""
        return self._path / "words" / self._words.metadata.encode_chunk_key((n, 0, 0))

    def check(self, n: int) -> None:
        """Raises InputError if chunk n is lost or damaged."""
        self._decoded(n)

    def _fits(self, path: Path) -> bool:
        """Whether the file of a chunk unpacks to a chunk, by what it states of itself."""
        size = CHUNK * 4 * self.shape[0] * self.shape[1]
        if any(type(codec).__name__ == "ZstdCodec" for codec in self._words.compressors):
            with path.open("rb") as file:
                return content_size(file.read(HEAD)) == size
        return path.stat().st_size <= size + _SUM

    def read_words(self, first: int, stop: int) -> Words:
        """See `SpikeStream`. Raises InputError if a chunk is damaged."""
        stop = min(stop, words_for(self.cycles))
        parts = [
            self._chunk(n)[max(first - n * CHUNK, 0) : stop - n * CHUNK]
            for n in range(first // CHUNK, -(-stop // CHUNK))
        ]
        if len(parts) == 1:
            return parts[0]
        return np.concatenate([np.empty((0, *self.shape), np.uint32), *parts])


def form_of(path: Path) -> Path:
    """The file of a store that states the form of its words. It is written before them, and
    again only if the number of cycles changes: what was read before is not of the same stream."""
    return path / "words" / "zarr.json"


def not_a_store(
    path: Path, actual: str, remedy: str = "run it again, or convert another file"
) -> InputError:
    """The error for a store that cannot be read."""
    return InputError(f"{path}", "the stream.zarr of a finished run", actual, remedy)


def _check_form(path: Path) -> None:
    """Raises InputError unless the array of words states the form that recorders write: format 3 of
    Zarr, whole chunks, codecs of _CODECS. It is read before zarr opens the store, which would load
    whatever codec a store names."""
    try:
        with form_of(path).open("rb") as file:
            told = json.loads(file.read(_MOST))
        form, node, named = told["zarr_format"], told["node_type"], told["codecs"]
        names = [str(codec["name"]) for codec in named]
    except (OSError, ValueError, TypeError, KeyError, RecursionError) as exc:
        raise not_a_store(path, "something else") from exc
    if form != 3 or node != "array":
        raise not_a_store(path, "something else")
    if names[:1] != ["bytes"] or not set(names[1:]) <= _CODECS:
        raise not_a_store(path, shorten(f"one with chunks of {', '.join(names)}"))


def content_size(head: bytes) -> int | None:
    """Bytes of a frame's content by its header (RFC 8878, section 3.1.1.1); None if it states none,
    or is no header.

    Args:
        head: the first `HEAD` bytes of a frame, or all of a shorter one.
    """
    if head[:4] != _MAGIC or len(head) < 5:
        return None
    descriptor = head[4]
    single = descriptor >> 5 & 1
    wide = (single, 2, 4, 8)[descriptor >> 6]
    at = 5 + (not single) + _ID[descriptor & 3]
    field = head[at : at + wide]
    if not wide or len(field) < wide:
        return None
    return int.from_bytes(field, "little") + (256 if wide == 2 else 0)
