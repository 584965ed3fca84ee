"""Zarr: the store of a run, written block by block and read in any part.

A group with the attributes `viform` (format version), `cycles`, `clock`, `start`, `complete`, and
one array `words` (n, H, W) uint32, a chunk for each 64 cycles, zstd with checksums. `complete`
turns true only when the last block has been written; a reader refuses the store before that.
Chunks without spikes are written as well, so that one that was lost is noticed.
"""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np
import numpy.typing as npt

from cosim.clock import Clock
from cosim.errors import InputError
from cosim.files.whole import whole
from cosim.spikes.viform import WORD, SpikeStream, Viform, Words, spikes_beyond, words_for
from cosim.stage import Block

if TYPE_CHECKING:
    import zarr

__all__ = ["Recorder", "ZarrStream", "write_zarr"]

VERSION = 1
_CHUNK = 2
"""Words in a chunk: 64 cycles, a block."""


def _bad(
    path: Path, given: str, remedy: str = "run it again, or convert another file"
) -> InputError:
    return InputError(f"{path}", "the stream.zarr of a finished run", given, remedy)


class ZarrStream:
    """A finished store as a spike stream; the chunk read last is kept."""

    def __init__(self, path: Path) -> None:
        import zarr  # a quarter of a second: only who opens a store pays for it

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
        self._path, self._words = path, words
        self._kept: tuple[int, Words] | None = None

    @property
    def shape(self) -> tuple[int, int]:
        """(height, width) in pixels."""
        return self._words.shape[1], self._words.shape[2]

    def _chunk(self, n: int) -> Words:
        if self._kept is None or self._kept[0] != n:
            key = self._words.metadata.encode_chunk_key((n, 0, 0))
            if not (self._path / "words" / key).is_file():
                raise _bad(self._path, f"one without chunk {n}", "copy it again, whole")
            try:
                words = cast(Words, self._words[n * _CHUNK : (n + 1) * _CHUNK])
            except Exception as exc:  # a chunk that does not decode
                raise _bad(self._path, f"damaged in chunk {n}") from exc
            last = n * _CHUNK + len(words) == words_for(self.cycles)
            if last and spikes_beyond(words[-1], self.cycles):
                raise _bad(self._path, "one with spikes beyond its last cycle")
            self._kept = (n, words)
        return self._kept[1]

    def read_words(self, first: int, stop: int) -> Words:
        """As `SpikeStream` says; InputError where a chunk is damaged."""
        stop = min(stop, words_for(self.cycles))
        parts = [
            self._chunk(n)[max(first - n * _CHUNK, 0) : stop - n * _CHUNK]
            for n in range(first // _CHUNK, -(-stop // _CHUNK))
        ]
        if len(parts) == 1:
            return parts[0]
        return np.concatenate([np.empty((0, *self.shape), np.uint32), *parts])


class Recorder:
    """The stage that writes a run's spikes. The store is made at the first block, or continued.

    Blocks come in order, of any size. A word that a block ends within is completed by the next.

    Attributes:
        bytes_written: of words, before compression.
    """

    def __init__(
        self, path: Path, shape: tuple[int, int], cycles: int, clock: Clock, start: int = 0
    ) -> None:
        self._start = start
        self._path, self._shape, self._cycles, self._clock = path, shape, cycles, clock
        self._array: Any = None
        self._open_word: Words | None = None
        self.bytes_written = 0

    def _create(self) -> None:
        import zarr
        from zarr.codecs import ZstdCodec

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
            compressors=ZstdCodec(level=1, checksum=True),
        )

    def _open(self, resumed: bool) -> Any:
        import zarr

        if not resumed:
            self._create()
        try:
            words = zarr.open_group(self._path, mode="r+")["words"]
        except Exception as exc:  # zarr raises many types for what is no store
            remedy = f"start afresh: remove {self._path.parent}"
            raise _bad(self._path, "missing or damaged", remedy) from exc
        # With the default, a chunk without spikes would be no file, just as one that was lost.
        return cast("zarr.Array[Any]", words).with_config({"write_empty_chunks": True})

    def step(self, data: Viform, block: Block) -> Viform:
        """Writes one block and hands it on."""
        if self._array is None:
            self._array = self._open(resumed=block.start > 0)
        words, offset = data.words, block.start % WORD
        if offset:  # go on in the word that the block before left open
            joined = np.zeros((words_for(offset + block.cycles), *self._shape), np.uint32)
            joined[: len(words)] = words << np.uint32(offset)
            spill = words[: len(joined) - 1] >> np.uint32(WORD - offset)
            joined[1 : 1 + len(spill)] |= spill
            if self._open_word is not None:
                joined[0] |= self._open_word
            words = joined
        first = block.start // WORD
        self._array[first : first + len(words)] = words
        self.bytes_written += words.nbytes
        self._open_word = words[-1].copy() if block.stop % WORD else None
        if block.stop == self._cycles:
            import zarr

            zarr.open_group(self._path, mode="r+").attrs["complete"] = True
        return data

    def state(self) -> dict[str, npt.NDArray[Any]]:
        """The word that is not full yet, where there is one."""
        return {} if self._open_word is None else {"open_word": self._open_word}

    def restore(self, state: dict[str, npt.NDArray[Any]]) -> None:
        """Go on from a `state`."""
        self._open_word = state.get("open_word")


def write_zarr(stream: SpikeStream, path: Path) -> None:
    """Writes any stream as a finished store; nothing of it is lost."""
    with whole(path) as part:
        start = getattr(stream, "start", 0)
        recorder = Recorder(part, stream.shape, stream.cycles, stream.clock, start)
        for first in range(0, words_for(stream.cycles), _CHUNK):
            words = stream.read_words(first, first + _CHUNK)
            at = first * WORD
            cycles = min(_CHUNK * WORD, stream.cycles - at)
            recorder.step(Viform(words, cycles, stream.clock, start + at), Block(at, cycles))
