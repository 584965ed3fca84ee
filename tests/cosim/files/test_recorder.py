"""A recorder that goes on from a state: the store must be as it was, or the recorder says so."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cosim import Clock
from cosim.files import Recorder, ZarrStream, storing
from cosim.stage import Block

CYCLES, SHAPE, CLOCK = 250, (3, 5), Clock(40_000)
STEPS = [Block(at, 50) for at in range(0, CYCLES, 50)]


def lose(store: Path) -> None:
    (store / "words/c/1/0/0").unlink()


def cut(store: Path) -> None:
    os.truncate(store / "words/c/1/0/0", 0)  # as file systems leave it


def flip(store: Path) -> None:
    chunk = store / "words/c/1/0/0"
    data = bytearray(chunk.read_bytes())
    data[len(data) // 2] ^= 1
    chunk.write_bytes(data)


def behead(store: Path) -> None:
    (store / "words/zarr.json").unlink()


@pytest.mark.parametrize("harm", [lose, cut, flip, behead, shutil.rmtree])
@pytest.mark.parametrize("store", ["raw", "small"])
def test_damage_to_what_a_state_builds_on_is_found(
    tmp_path: Path, random_stream: Any, harm: Callable[[Path], None], store: str
) -> None:
    stream, path = random_stream(CYCLES, SHAPE), tmp_path / "a.zarr"
    with storing(store):
        recorder = Recorder(path, SHAPE, CYCLES, CLOCK)
        for block in STEPS[:-1]:
            recorder.step(stream[block.start : block.stop], block)
    state = recorder.state()
    counted: list[tuple[int, int]] = []
    again = Recorder(path, SHAPE, CYCLES, CLOCK)
    assert again.damage(state, lambda *n: counted.append(n)) is None
    assert counted == [(1, 4), (2, 4), (3, 4), (4, 4)]
    other = Recorder(path, SHAPE[::-1], CYCLES, CLOCK)
    assert "not that of another run" in str(other.damage(state, lambda *n: None))
    harm(path)
    found = again.damage(state, lambda *n: None)
    assert found is not None and found.startswith(f"{path} must be as the run wrote it, not ")


def test_what_was_written_after_the_state_does_not_matter(
    tmp_path: Path, random_stream: Any
) -> None:
    """Chunks of later cycles may be lost, half written or damaged: all of them are made again."""
    stream, path = random_stream(CYCLES, SHAPE), tmp_path / "a.zarr"
    recorder = Recorder(path, SHAPE, CYCLES, CLOCK)
    for block in STEPS:
        recorder.step(stream[block.start : block.stop], block)
        if block.stop == 100:
            state = recorder.state()
    whole = {file: file.read_bytes() for file in path.rglob("*") if file.is_file()}
    (path / "words/c/2/0/0").write_bytes(b"half")
    (path / "words/c/3/0/0").unlink()
    again = Recorder(path, SHAPE, CYCLES, CLOCK)
    assert again.damage(state, lambda *n: None) is None
    again.restore(state)
    again.step(stream[100:150], STEPS[2])
    assert not (path / "words/c/3/0/0").exists()
    assert np.array_equal(again.read_back(0, 4), stream.words[:4])
    for block in STEPS[3:]:
        again.step(stream[block.start : block.stop], block)
    assert {file: file.read_bytes() for file in path.rglob("*") if file.is_file()} == whole
    assert np.array_equal(ZarrStream(path).read_words(0, 8), stream.words)


def test_a_day_that_goes_on_looks_at_the_chunks_that_are_there(
    tmp_path: Path, random_stream: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A stream of unknown length is laid out for a day, of which tens of millions of chunks are
    never written."""
    stream, path, day = random_stream(CYCLES, SHAPE), tmp_path / "a.zarr", 86_400 * 40_000
    recorder = Recorder(path, SHAPE, day, CLOCK)
    for block in STEPS:
        recorder.step(stream[block.start : block.stop], block)
        if block.stop == 100:
            state = recorder.state()
    recorder.end(CYCLES)
    again = Recorder(path, SHAPE, day, CLOCK)
    again.restore(state)
    removed: list[Path] = []
    unlink = Path.unlink

    def counted(file: Path, **given: Any) -> None:
        removed.append(file)
        assert len(removed) < 10, "more files than the store has"
        unlink(file, **given)

    monkeypatch.setattr(Path, "unlink", counted)
    again.step(stream[100:150], STEPS[2])
    assert sorted(removed) == [path / f"words/c/{n}/0/0" for n in (2, 3)]
    monkeypatch.undo()
    for block in STEPS[3:]:
        again.step(stream[block.start : block.stop], block)
    again.end(CYCLES)
    assert np.array_equal(ZarrStream(path).read_words(0, 8), stream.words)
