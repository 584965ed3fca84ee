"""Zarr: the store of a run, written block by block and read in any part.

The store is a group with the attributes `viform` (format version), `cycles`, `clock`, `start` and
`complete`, and one array `words` (n, H, W) uint32, in chunks of 64 cycles with zstd and checksums.
`complete` becomes true after the last block; readers refuse the store before. Chunks without spikes
are also written, so that a lost chunk is detected. How chunks are compressed is a choice of the run
(`storing`); every reader reads all of them.
"""

from __future__ import annotations

import shutil
from collections import OrderedDict, deque
from collections.abc import Iterator, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path
from threading import Lock
from typing import TYPE_CHECKING, Any, Final, cast

import numpy as np
import numpy.typing as npt
import psutil

from cosim.clock import Clock
from cosim.compute.memory import check_plane
from cosim.errors import InputError
from cosim.files.whole import whole
from cosim.files.zstd import HEAD, content_size
from cosim.spikes.viform import WORD, SpikeStream, Viform, Words, spikes_beyond, words_for
from cosim.stage import Block

if TYPE_CHECKING:
    import zarr

__all__ = [
    "NOT_KEPT", "STORES", "Recorder", "ZarrStream", "kept_bytes", "storing", "streams_kept",
    "write_zarr",
]  # fmt: skip

VERSION = 1
NOT_KEPT: Final = "none"
"""Name of the store whose streams are removed at the end of a run."""
STORES: Final = {"raw": None, "fast": 1, "small": 9, NOT_KEPT: None}
"""Level of zstd by the name of a store, None for no compression. A film at .3 spikes a cycle takes
1, .51 and .39 bit a pixel and cycle; small takes ten times the processor time of fast."""
_STORE: ContextVar[str] = ContextVar("store", default="fast")
_CHUNK = 2
"""Words in a chunk: 64 cycles, a block."""
_KEPT = 1 << 26
"""Bytes of decoded chunks that a reader keeps, beside the last one."""
_WRITTEN = 1 << 29
"""Bytes of chunks that a recorder keeps, at most: 4096 cycles of 1000 x 1000 pixels."""
_SUM = 4
"""Bytes of a chunk's checksum without compression."""
_AHEAD = 2
"""Blocks that a recorder compresses and writes at the same time."""
_SHARE = 8
"""They take at most one part in so many of the free memory."""


def _bad(
    path: Path, actual: str, remedy: str = "run it again, or convert another file"
) -> InputError:
    return InputError(f"{path}", "the stream.zarr of a finished run", actual, remedy)


@contextmanager
def storing(name: str) -> Iterator[None]:
    """Within it, new recorders compress as this entry of STORES says."""
    before = _STORE.set(name)
    try:
        yield
    finally:
        _STORE.reset(before)


def kept_bytes(size: int) -> int:
    """Bytes that a recorder with `keep` holds in memory, of `size` bytes that it writes."""
    return min(size, _WRITTEN, psutil.virtual_memory().available // _SHARE)


def streams_kept() -> bool:
    """Whether the streams of the run that is made remain in its folder."""
    return _STORE.get() != NOT_KEPT


class ZarrStream:
    """A complete store as a spike stream, for any number of threads. The last chunks are kept.
    Raises InputError for others.

    written: chunks by number that are in memory already, and are not read from the store.

    Attributes:
        kept: bytes of decoded chunks that are kept, beside the last one.
    """

    def __init__(
        self, path: Path, written: Mapping[int, Words] | None = None, kept: int = _KEPT
    ) -> None:
        import zarr  # takes a quarter of a second, so only if a store is opened

        try:
            group = zarr.open_group(path, mode="r")
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
            raise _bad(path, "something else") from exc
        if version != VERSION:
            raise _bad(path, f"format {version}", f"use a program that writes format {VERSION}")
        if complete is not True:
            raise _bad(
                path,
                "one that was interrupted",
                f"finish it: viform run {path.parent} --resume --out {path.parent}",
            )
        shape_ok = words.ndim == 3 and words.shape[0] == words_for(self.cycles)
        if words.dtype != np.uint32 or not shape_ok or 0 in words.shape:
            raise _bad(path, f"words of shape {words.shape} for {self.cycles} cycles")
        if words.chunks != (_CHUNK, *words.shape[1:]):
            raise _bad(path, f"chunks of shape {words.chunks}")
        codecs = {type(codec).__name__ for codec in words.compressors}
        if words.shards is not None or words.filters or not codecs <= {"ZstdCodec", "Crc32cCodec"}:
            raise _bad(path, f"one with chunks of {', '.join(sorted(codecs))}")
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
        key = self._words.metadata.encode_chunk_key((n, 0, 0))
        if not (self._path / "words" / key).is_file():
            raise _bad(self._path, f"one without chunk {n}", "copy it again, whole")
        if not self._fits(self._path / "words" / key):
            raise _bad(self._path, f"damaged in chunk {n}")
        try:
            words = cast(Words, self._words[n * _CHUNK : (n + 1) * _CHUNK])
        except Exception as exc:  # a chunk that does not decode
            raise _bad(self._path, f"damaged in chunk {n}") from exc
        last = n * _CHUNK + len(words) == words_for(self.cycles)
        if last and spikes_beyond(words[-1], self.cycles):
            raise _bad(self._path, "one with spikes beyond its last cycle")
        return words

    def _fits(self, path: Path) -> bool:
        """Whether the file of a chunk unpacks to a chunk, by what it states of itself."""
        size = _CHUNK * 4 * self.shape[0] * self.shape[1]
        if any(type(codec).__name__ == "ZstdCodec" for codec in self._words.compressors):
            with path.open("rb") as file:
                return content_size(file.read(HEAD)) == size
        return path.stat().st_size <= size + _SUM

    def read_words(self, first: int, stop: int) -> Words:
        """See `SpikeStream`. Raises InputError if a chunk is damaged."""
        stop = min(stop, words_for(self.cycles))
        parts = [
            self._chunk(n)[max(first - n * _CHUNK, 0) : stop - n * _CHUNK]
            for n in range(first // _CHUNK, -(-stop // _CHUNK))
        ]
        if len(parts) == 1:
            return parts[0]
        return np.concatenate([np.empty((0, *self.shape), np.uint32), *parts])


class Recorder:
    """The stage that writes the spikes of a run. It creates the store at the first block, or
    continues it.

    Blocks come in order and have any size. The next block completes a word that a block ends
    within. Blocks of whole chunks are written in threads, `_AHEAD` at a time: `state` and the last
    block wait for them, and what a thread raises is raised by a later step.

    Args:
        keep: whether blocks stay in memory for `recorded`, up to `kept_bytes`.
        watch: rows and columns, two arrays that broadcast, of pixels whose words stay in memory;
            None for no pixels.

    Attributes:
        bytes_written: bytes of words, before compression.
        spikes: spikes so far, also of the run that is resumed.
        stop: the cycle after the last one that this process has written.
        watched: words of the watched pixels, (words, ...) uint32 with the shape of `watch`; None
            without any.
    """

    def __init__(
        self, path: Path, shape: tuple[int, int], cycles: int, clock: Clock, start: int = 0,
        *, keep: bool = False,
        watch: tuple[npt.NDArray[np.intp], npt.NDArray[np.intp]] | None = None,
    ) -> None:  # fmt: skip
        self._start, self._store = start, _STORE.get()
        self._path, self._shape, self._cycles, self._clock = path, shape, cycles, clock
        self._array: Any = None
        self._pool: ThreadPoolExecutor | None = None
        self._writing: deque[Future[None]] = deque()
        self._open_word: Words | None = None
        self._written: dict[int, Words] = {}
        self._room = kept_bytes(words_for(cycles) * 4 * shape[0] * shape[1]) if keep else 0
        self.bytes_written = self.spikes = self.stop = 0
        self._watch = watch
        self.watched: Words | None = None
        if watch is not None:
            self.watched = np.zeros((words_for(cycles), *np.broadcast(*watch).shape), np.uint32)

    def _create(self) -> None:
        """Creates the store, without words."""
        import zarr
        from zarr.codecs import Crc32cCodec, ZstdCodec

        level = STORES[self._store]
        if self._path.exists():
            shutil.rmtree(self._path)
        group = zarr.create_group(self._path)
        group.attrs.update(
            viform=VERSION,
            cycles=self._cycles,
            clock=[self._clock.num, self._clock.den],
            start=self._start,
            complete=False,
        )
        group.create_array(
            "words",
            shape=(words_for(self._cycles), *self._shape),
            chunks=(_CHUNK, *self._shape),
            dtype="uint32",
            compressors=Crc32cCodec() if level is None else ZstdCodec(level=level, checksum=True),
        )

    def _store_of(self) -> Any:
        """The store to write to: large chunks that are not compressed pass by the file cache."""
        from cosim.files.direct import DirectStore

        return DirectStore(self._path) if STORES[self._store] is None else self._path

    def _open(self, resumed: bool) -> Any:
        """The array of words, of a new store unless the run is resumed."""
        import zarr

        if not resumed:
            self._create()
        try:
            if zarr.open_group(self._path, mode="r").attrs["cycles"] != self._cycles:
                self._resize(self._cycles, complete=False)  # it was ended before its time
            words = zarr.open_group(self._store_of(), mode="r+")["words"]
        except Exception as exc:  # zarr raises many types for what is no store
            remedy = f"start afresh: remove {self._path.parent}"
            raise _bad(self._path, "missing or damaged", remedy) from exc
        # By default, a chunk without spikes has no file, like a lost one.
        return cast("zarr.Array[Any]", words).with_config({"write_empty_chunks": True})

    def step(self, data: Viform, block: Block) -> Viform:
        """Writes a block and returns it."""
        if self._array is None:
            self._array = self._open(resumed=block.start > 0)
        words, offset = data.words, block.start % WORD
        self.spikes += int(np.bitwise_count(words).sum(dtype=np.int64))
        if offset:  # continue the incomplete word of the previous block
            joined = np.zeros((words_for(offset + block.cycles), *self._shape), np.uint32)
            joined[: len(words)] = words << np.uint32(offset)
            spill = words[: len(joined) - 1] >> np.uint32(WORD - offset)
            joined[1 : 1 + len(spill)] |= spill
            if self._open_word is not None:
                joined[0] |= self._open_word
            words = joined
        first = block.start // WORD
        self._write(first, words, block)
        if self._watch is not None and self.watched is not None:
            rows, columns = self._watch
            self.watched[first : first + len(words)] = words[:, rows, columns]
        self.bytes_written += words.nbytes
        self.stop = block.stop
        if block.start % (_CHUNK * WORD) == 0:
            self._keep(words, block)
        self._open_word = words[-1].copy() if block.stop % WORD else None
        if block.stop == self._cycles:
            import zarr

            self._settle()
            zarr.open_group(self._path, mode="r+").attrs["complete"] = True
        return data

    def _write(self, first: int, words: Words, block: Block) -> None:
        """Writes words from number `first` on: in a thread if they are whole chunks, which no other
        block changes."""
        if block.start % (_CHUNK * WORD) or block.cycles % (_CHUNK * WORD):
            self._settle()
            self._array[first : first + len(words)] = words
            return
        self._settle(_AHEAD - 1)
        if self._pool is None:
            self._pool = ThreadPoolExecutor(_AHEAD)
        where = slice(first, first + len(words))
        self._writing.append(self._pool.submit(self._array.__setitem__, where, words))

    def _settle(self, most: int = 0) -> None:
        """Waits until at most so many blocks are being written. Raises what their threads raise."""
        while len(self._writing) > most:
            self._writing.popleft().result()

    def _keep(self, words: Words, block: Block) -> None:
        """Keeps the complete chunks of a block that begins with a chunk, as long as there is
        room."""
        for at in range(0, len(words), _CHUNK):
            chunk, stop = words[at : at + _CHUNK], block.start + (at + _CHUNK) * WORD
            if stop > block.stop < self._cycles or chunk.nbytes > self._room:
                return
            self._written[block.start // (_CHUNK * WORD) + at // _CHUNK] = chunk
            self._room -= chunk.nbytes

    def end(self, cycles: int) -> None:
        """Makes a sound store of the first `cycles` cycles, at least one, all of which have been
        written; a stream may end before its time. A run that goes on continues it."""
        self._settle()
        self._resize(cycles, complete=True)

    def _resize(self, cycles: int, *, complete: bool) -> None:
        import zarr
        from zarr.core.sync import sync

        group = zarr.open_group(self._path, mode="r+")
        words = cast("zarr.Array[Any]", group["words"])
        shape = (words_for(cycles), *self._shape)
        # Chunks beyond the end were never written; to look for them takes minutes in a long store.
        sync(words.async_array.resize(shape, delete_outside_chunks=False))
        group.attrs.update(cycles=cycles, complete=complete)

    def recorded(self) -> ZarrStream:
        """The complete store as a stream. What is kept in memory is not decoded again. Raises
        InputError before the last block."""
        return ZarrStream(self._path, self._written)

    def read_back(self, first: int, stop: int) -> Words:
        """Words `first` to `stop` (excluded) that were written before, also by the run that this
        one resumes."""
        if self._array is None:
            self._array = self._open(resumed=True)
        self._settle()
        return cast(Words, self._array[first:stop])

    def state(self) -> dict[str, npt.NDArray[Any]]:
        """The number of spikes, the incomplete word, and the words of watched pixels; all earlier
        words are in the store."""
        self._settle()
        parts = {"open_word": self._open_word, "watched": self.watched}
        state = {key: part.copy() for key, part in parts.items() if part is not None}
        return {"spikes": np.full(1, self.spikes), **state}

    def restore(self, state: dict[str, npt.NDArray[Any]]) -> None:
        """Continues from a `state`."""
        self._open_word, self.spikes = state.get("open_word"), int(state["spikes"][0])
        self.watched = state.get("watched")


def write_zarr(stream: SpikeStream, path: Path) -> None:
    """Writes a stream as a complete store, without loss."""
    with whole(path) as part:
        start = getattr(stream, "start", 0)
        recorder = Recorder(part, stream.shape, stream.cycles, stream.clock, start)
        for first in range(0, words_for(stream.cycles), _CHUNK):
            words = stream.read_words(first, first + _CHUNK)
            at = first * WORD
            cycles = min(_CHUNK * WORD, stream.cycles - at)
            recorder.step(Viform(words, cycles, stream.clock, start + at), Block(at, cycles))
