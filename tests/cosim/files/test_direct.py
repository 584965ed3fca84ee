"""Direct writes: the same bytes as through the file cache, whole or not at all."""

from __future__ import annotations

import errno
import os
from pathlib import Path

import numpy as np
import pytest

from cosim import Block, Clock, Viform
from cosim.files import Recorder, ZarrStream, direct, storing
from cosim.spikes.viform import words_for

SHAPE = (513, 401)
"""Its chunks are no multiple of a sector."""


def record(path: Path, random_stream) -> np.ndarray:
    """Records 200 cycles without compression; the last chunk is not whole."""
    stream = random_stream(200, SHAPE)
    with storing("raw"):
        recorder = Recorder(path, SHAPE, 200, Clock(40_000))
        for at in range(0, 200, 64):
            cycles = min(64, 200 - at)
            words = stream.words[at // 32 : at // 32 + words_for(cycles)]
            recorder.step(Viform(words, cycles, stream.clock, at), Block(at, cycles))
    return stream.words


def read(path: Path) -> np.ndarray:
    return ZarrStream(path).read_words(0, words_for(200))


@pytest.fixture
def sizes(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Sizes of the values that were written by `direct`, which takes all of 100 kB and more."""
    written: list[int] = []
    put = direct._put

    def counted(path: Path, value: memoryview) -> float | None:
        written.append(len(value))
        return put(path, value)

    monkeypatch.setattr(direct, "_put", counted)
    monkeypatch.setattr(direct, "_LEAST", 100_000)
    return written


def test_a_recording_has_the_same_words(tmp_path: Path, random_stream, sizes: list[int]) -> None:
    words = record(tmp_path / "a.zarr", random_stream)
    np.testing.assert_array_equal(read(tmp_path / "a.zarr"), words)
    assert sizes[0] == 2 * SHAPE[0] * SHAPE[1] * 4 + 4  # two words a pixel and a checksum
    assert not list(tmp_path.rglob("*.partial"))


def test_without_direct_writes_the_cache_is_used(
    tmp_path: Path, random_stream, sizes: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(direct, "_open", lambda path: None)
    words = record(tmp_path / "a.zarr", random_stream)
    np.testing.assert_array_equal(read(tmp_path / "a.zarr"), words)
    assert len(sizes) < 3  # two values are written at a time, the next are not tried


def test_a_file_system_without_direct_writes_is_recognised(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*given: object) -> int:
        raise OSError(errno.EINVAL, "Invalid argument")

    with monkeypatch.context() as patch:
        patch.setattr(os, "open", refuse)
        assert direct._open(tmp_path / "a") is None
    monkeypatch.delattr(os, "O_DIRECT", raising=False)
    assert direct._open(tmp_path / "a") is None


def test_a_slow_disk_is_left_to_the_cache(
    tmp_path: Path, random_stream, sizes: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(direct, "_SLOW", 1e15)
    monkeypatch.setattr(direct, "_GRACE", 1e-12)
    words = record(tmp_path / "a.zarr", random_stream)
    np.testing.assert_array_equal(read(tmp_path / "a.zarr"), words)
    assert len(sizes) < 3


def test_a_full_disk_leaves_no_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*given: object) -> int:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(os, "write", full)
    with pytest.raises(OSError, match="No space left"):
        direct._put(tmp_path / "chunk", memoryview(bytes(1 << 16)))
    assert list(tmp_path.iterdir()) == []
