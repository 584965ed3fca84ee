"""Zarr: the store of a run, written block by block and read in any part.

A group with the attributes `viform` (format version), `cycles`, `clock`, `start`, `complete`, and
one array `words` (n, H, W) uint32, a chunk for each 64 cycles, zstd. `complete` turns true only
when the last block has been written; a reader refuses the store before that.
"""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any, cast

import numpy as np
import numpy.typing as npt
import zarr
from zarr.codecs import ZstdCodec

from cosim.clock import Clock
from cosim.errors import InputError
from cosim.files.whole import whole
from cosim.loop import Block
from cosim.viform import WORD, SpikeStream, Viform, Words, words_for

__all__ = ["Recorder", "ZarrStream", "write_zarr"]

VERSION = 1
_CHUNK = 2
"""Words in a chunk: 64 cycles, a block."""


def _bad(path: Path, given: str, mend: str = "run it again, or convert another file") -> InputError:
    return InputError(f"{path}", "the stream.zarr of a finished run", given, mend)


class ZarrStream:
    """A finished store as a spike stream; the chunk read last is kept."""

    def __init__(self, path: Path) -> None:
        try:
            group = zarr.open_group(str(path), mode="r")
            attributes = dict(group.attrs)
            words = cast(zarr.Array[Any], group["words"])
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
                path, "one that was interrupted", f"finish it: viform run --resume --out {path.parent}"
            )
        shape_ok = words.ndim == 3 and words.shape[0] == words_for(self.cycles)
        if words.dtype != np.uint32 or not shape_ok or 0 in words.shape:
            raise _bad(path, f"words of shape {words.shape} for {self.cycles} cycles")
        self._path, self._words = path, words
        self._kept: tuple[int, Words] | None = None

    @property
    def shape(self) -> tuple[int, int]:
        return self._words.shape[1], self._words.shape[2]

    def _chunk(self, n: int) -> Words:
        if self._kept is None or self._kept[0] != n:
            try:
                words = self._words[n * _CHUNK : (n + 1) * _CHUNK]
            except Exception as exc:  # a chunk that does not decode
                raise _bad(self._path, f"damaged in chunk {n}") from exc
            self._kept = (n, cast(Words, np.asarray(words)))
        return self._kept[1]

    def read_words(self, first: int, stop: int) -> Words:
        stop = min(stop, words_for(self.cycles))
        parts = [
            self._chunk(n)[max(first - n * _CHUNK, 0) : stop - n * _CHUNK]
            for n in range(first // _CHUNK, -(-stop // _CHUNK))
        ]
        return parts[0] if len(parts) == 1 else np.concatenate(parts)


class Recorder:
    """The stage that writes a run's spikes. The store is made at the first block or gone on with.

    stop: cycles of the whole run. Blocks come in order; each starts on a whole word unless it
    goes on in the word where the one before it ended.
    """

    def __init__(self, path: Path, shape: tuple[int, int], cycles: int, clock: Clock) -> None:
        self._path, self._shape, self._cycles, self._clock = path, shape, cycles, clock
        self._array: Any = None
        self._open_word: Words | None = None
        self.bytes_written = 0

    def _create(self) -> Any:
        if self._path.exists():
            shutil.rmtree(self._path)
        group = zarr.create_group(str(self._path))
        group.attrs.update(
            viform=VERSION,
            cycles=self._cycles,
            clock=[self._clock.num, self._clock.den],
            start=0,
            complete=False,
        )
        return group.create_array(
            "words",
            shape=(words_for(self._cycles), *self._shape),
            chunks=(_CHUNK, *self._shape),
            dtype="uint32",
            compressors=ZstdCodec(level=1),
        )

    def step(self, given: Viform, block: Block) -> Viform:
        """Writes one block and hands it on."""
        if self._array is None:
            resumed = block.start > 0
            self._array = (
                zarr.open_group(str(self._path), mode="r+")["words"] if resumed else self._create()
            )
        words, offset = given.words, block.start % WORD
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
            zarr.open_group(str(self._path), mode="r+").attrs["complete"] = True
        return given

    def state(self) -> dict[str, npt.NDArray[Any]]:
        """The word that is not full yet, where there is one."""
        return {} if self._open_word is None else {"open_word": self._open_word}

    def restore(self, state: dict[str, npt.NDArray[Any]]) -> None:
        self._open_word = state.get("open_word")


def write_zarr(stream: SpikeStream, path: Path) -> None:
    """Writes any stream as a finished store."""
    with whole(path) as part:
        recorder = Recorder(part, stream.shape, stream.cycles, stream.clock)
        for first in range(0, words_for(stream.cycles), _CHUNK):
            words = stream.read_words(first, first + _CHUNK)
            start = first * WORD
            cycles = min(_CHUNK * WORD, stream.cycles - start)
            recorder.step(Viform(words, cycles, stream.clock, start), Block(start, cycles))
