"""The stage that writes the spikes of a run into a store (`zarr_store`), and the choice of its
compression.

What a recorder has written before a checkpoint is on the disk before the checkpoint is, and
`complete` is set after all chunks are. A run that is resumed compares every chunk that its
checkpoint builds on with the chunk's checksum.
"""

from __future__ import annotations

import shutil
from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, cast

import numpy as np
import numpy.typing as npt

from cosim.clock import Clock
from cosim.compute.cores import cores
from cosim.compute.memory import free_memory
from cosim.errors import InputError
from cosim.files.atomic import atomic_write, sync_all
from cosim.files.zarr_store import CHUNK, KEPT, VERSION, ZarrStream, not_a_store
from cosim.spikes.viform import WORD, SpikeStream, Viform, Words, words_for
from cosim.stage import Block, State

if TYPE_CHECKING:
    import zarr

NOT_KEPT: Final = "none"
"""Name of the store whose streams are removed at the end of a run."""
STORES: Final = {"raw": None, "fast": 1, "small": 9, NOT_KEPT: None}
"""Level of zstd by the name of a store, None for no compression. A film at .3 spikes a cycle takes
1, .51 and .39 bit a pixel and cycle; small takes ten times the processor time of fast."""
_STORE: ContextVar[str] = ContextVar("store", default="fast")
_WRITTEN = 1 << 29
"""Bytes of chunks that a recorder keeps, at most: 4096 cycles of 1000 x 1000 pixels."""
_AHEAD = 2
"""Blocks that a recorder compresses and writes at the same time."""
_SHARE = 8
"""The blocks take at most one part in so many of the free memory."""


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
    return min(size, _WRITTEN, free_memory() // _SHARE)


def streams_kept() -> bool:
    """Whether the streams of the run that is made remain in its folder."""
    return _STORE.get() != NOT_KEPT


def _chunks(cycles: int) -> int:
    """Chunks that hold so many cycles."""
    return -(-cycles // (CHUNK * WORD))


class Recorder:
    """The stage that writes the spikes of a run. It creates the store at the first block, or
    continues it.

    Blocks come in order and have any size. The next block completes a word that a block ends
    within. Blocks of whole chunks are written in threads, `_AHEAD` at a time: `state` and the last
    block wait for them, and what a thread raises is raised by a later step. `state` and the end
    wait for the disk as well.

    Args:
        keep: whether blocks stay in memory for `recorded`, up to `kept_bytes`.
        watch: rows and columns, two arrays that broadcast, of pixels whose words stay in memory;
            None for no pixels.

    Attributes:
        bytes_written: bytes of words, before compression.
        spikes: spikes so far, also of the run that is resumed.
        stop: the cycle after the last one that is written, also by the run that is resumed.
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
        self._synced: int | None = None  # chunks before this one are on the disk
        self._written: dict[int, Words] = {}
        size = words_for(cycles) * 4 * shape[0] * shape[1]
        self._room = kept_bytes(size) if keep else 0
        if self._room < size:  # `recorded` decodes the others, and keeps some of those
            self._room = max(self._room - KEPT, 0)
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
            chunks=(CHUNK, *self._shape),
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
            group = zarr.open_group(self._store_of(), mode="r+")
            if group.attrs["cycles"] != self._cycles:  # it was ended before its time
                self._resize(self._cycles, complete=False)
                group = zarr.open_group(self._store_of(), mode="r+")
            words = group["words"]
            if resumed and self.stop < self._cycles:
                self._go_back(group)
        except Exception as exc:  # zarr raises many types for what is no store
            remedy = f"start afresh: remove {self._path.parent}"
            raise not_a_store(self._path, "missing or damaged", remedy) from exc
        # By default, a chunk without spikes has no file, like a lost one.
        return cast("zarr.Array[Any]", words).with_config({"write_empty_chunks": True})

    def _go_back(self, group: Any) -> None:
        """Makes the store as it was at the checkpoint that the run is resumed from."""
        if group.attrs["complete"]:
            group.attrs["complete"] = False
        # Those that are there: a stream of unknown length is laid out for tens of millions.
        for folder in (self._path / "words").glob("c/*"):
            if int(folder.name) >= _chunks(self.stop):
                self._chunk_path(int(folder.name)).unlink(missing_ok=True)

    def _chunk_path(self, n: int) -> Path:
        """File of chunk n, by the key that zarr gives it by default."""
        return self._path / "words" / "c" / str(n) / "0" / "0"

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
        if block.start % (CHUNK * WORD) == 0:
            self._keep(words, block)
        self._open_word = words[-1].copy() if block.stop % WORD else None
        self.stop = block.stop
        if block.stop == self._cycles:
            self._finish()
        return data

    def _finish(self, *, to: int | None = None) -> None:
        """States that the store is complete, after all of it is on the disk. to: number of cycles
        that it is cut to."""
        import zarr

        self._settle()
        kept = self._store != NOT_KEPT
        if kept:
            self._sync()
        headers = [self._path / "zarr.json"]
        if to is None:
            zarr.open_group(self._path, mode="r+").attrs["complete"] = True
        else:
            self._resize(to, complete=True)
            headers.append(self._path / "words" / "zarr.json")
        if kept:
            sync_all([*headers, *(file.parent for file in headers)])
        else:
            self._synced = None  # `state` syncs all of it, if it is called

    def _sync(self) -> None:
        """Waits until all that was written is on the disk: chunks since the last time, and the
        folders with their names."""
        if self._array is None:
            return
        words = self._path / "words"
        files = [self._chunk_path(n) for n in range(self._synced or 0, _chunks(self.stop))]
        folders = {folder for file in files for folder in (file.parent, file.parent.parent)}
        folders.add(words / "c")
        if self._synced is None:
            files += [self._path / "zarr.json", words / "zarr.json"]
            folders |= {words, self._path, self._path.parent}
        sync_all(files)
        sync_all(folders)
        self._synced = self.stop // (CHUNK * WORD)

    def _write(self, first: int, words: Words, block: Block) -> None:
        """Writes words from number `first` on: in a thread if they are whole chunks, which no other
        block changes."""
        if block.start % (CHUNK * WORD) or block.cycles % (CHUNK * WORD):
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
        for at in range(0, len(words), CHUNK):
            chunk, stop = words[at : at + CHUNK], block.start + (at + CHUNK) * WORD
            if stop > block.stop < self._cycles or chunk.nbytes > self._room:
                return
            self._written[block.start // (CHUNK * WORD) + at // CHUNK] = chunk
            self._room -= chunk.nbytes

    def end(self, cycles: int) -> None:
        """Makes a sound store of the first `cycles` cycles, at least one, all of which have been
        written; a stream may end before its time. A run that goes on continues it."""
        self._finish(to=cycles)

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
        """Cycles and spikes so far, the incomplete word, and the words of watched pixels; all
        earlier words are in the store, on the disk."""
        self._settle()
        self._sync()
        parts = {"open_word": self._open_word, "watched": self.watched}
        state = {key: part.copy() for key, part in parts.items() if part is not None}
        return {"cycles": np.full(1, self.stop), "spikes": np.full(1, self.spikes), **state}

    def restore(self, state: dict[str, npt.NDArray[Any]]) -> None:
        """Continues from a `state`."""
        self._open_word, self.spikes = state.get("open_word"), int(state["spikes"][0])
        self.stop = int(state["cycles"][0])
        self._synced = self.stop // (CHUNK * WORD)
        self.watched = state.get("watched")

    def damage(self, state: State, checked: Callable[[int, int], None]) -> str | None:
        """See `WithFiles`."""
        stop = int(state["cycles"][0]) if "cycles" in state else 0
        chunks = _chunks(stop)
        if not chunks:
            return None
        try:
            if not self._path.exists():
                raise not_a_store(self._path, "lost")
            stream = ZarrStream(self._path, kept=0, unfinished=stop < self._cycles)
            mine = (stream.shape, stream.clock, stream.start) == (
                self._shape, self._clock, self._start,
            )  # fmt: skip
            if not (mine and stop <= stream.cycles <= self._cycles):  # it may have been ended
                raise not_a_store(self._path, "that of another run")
            pool = ThreadPoolExecutor(min(cores(), 16))
            try:
                for n, _ in enumerate(pool.map(stream.check, range(chunks))):
                    checked(n + 1, chunks)
            finally:
                pool.shutdown(cancel_futures=True)
        except InputError as exc:
            return f"{self._path} must be as the run wrote it, not {exc.actual}"
        return None


def write_zarr(stream: SpikeStream, path: Path) -> None:
    """Writes a stream as a complete store, without loss."""
    with atomic_write(path) as part:
        start = getattr(stream, "start", 0)
        recorder = Recorder(part, stream.shape, stream.cycles, stream.clock, start)
        for first in range(0, words_for(stream.cycles), CHUNK):
            words = stream.read_words(first, first + CHUNK)
            at = first * WORD
            cycles = min(CHUNK * WORD, stream.cycles - at)
            recorder.step(Viform(words, cycles, stream.clock, start + at), Block(at, cycles))
