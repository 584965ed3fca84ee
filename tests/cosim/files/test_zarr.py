"""The store of a run: any split of the run gives the same words, and a damaged store is refused."""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import zarr
from hypothesis import given, settings
from hypothesis import strategies as st

from cosim import Block, Clock, InputError, Viform
from cosim.files import STORES, Recorder, ZarrStream, open_stream, storing
from cosim.files.recorder import write_zarr
from cosim.spikes.viform import pack_planes, part_of, words_for

CLOCK = Clock(40_000)
SHAPE = (2, 3)


def pieces(stream: Viform, sizes: list[int], first: int = 0) -> Iterator[tuple[Viform, Block]]:
    """Records the stream from cycle `first` on in blocks of these sizes, repeated."""
    planes = stream.planes()
    n = 0
    while first < stream.cycles:
        cycles = min(sizes[n % len(sizes)], stream.cycles - first)
        words = pack_planes(planes[first : first + cycles])
        yield Viform(words, cycles, stream.clock, first), Block(first, cycles)
        first, n = first + cycles, n + 1


def record(stream: Viform, path: Path, sizes: list[int]) -> Recorder:
    recorder = Recorder(path, stream.shape, stream.cycles, stream.clock)
    for given_, block in pieces(stream, sizes):
        assert recorder.step(given_, block) is given_
    return recorder


def words_of(path: Path) -> np.ndarray:
    stream = ZarrStream(path)
    return stream.read_words(0, words_for(stream.cycles))


@pytest.mark.parametrize("sizes", [[64], [32], [7], [1], [45, 3, 64, 1], [31, 33]])
@pytest.mark.parametrize("cycles", [1, 75, 128])
def test_blocks_of_any_size_give_the_same_words(
    tmp_path: Path, random_stream, sizes: list[int], cycles: int
) -> None:
    stream = random_stream(cycles, SHAPE)
    record(stream, tmp_path / "a.zarr", sizes)
    again = ZarrStream(tmp_path / "a.zarr")
    assert (again.cycles, again.shape, again.clock, again.start) == (cycles, SHAPE, CLOCK, 0)
    np.testing.assert_array_equal(words_of(tmp_path / "a.zarr"), stream.words)


@pytest.mark.parametrize("sizes", [[64], [128, 192], [32], [45, 3, 64, 1], [200]])
@pytest.mark.parametrize("cycles", [75, 256, 300])
def test_a_recorder_gives_what_it_wrote(
    tmp_path: Path, random_stream, monkeypatch, sizes: list[int], cycles: int
) -> None:
    stream = random_stream(cycles, SHAPE)
    for room in (0, 3 * stream.words[:2].nbytes, 2**20):  # of no chunk, of three, of all
        monkeypatch.setattr("cosim.files.recorder._WRITTEN", room)
        path = tmp_path / f"{room}.zarr"
        recorder = Recorder(path, SHAPE, cycles, CLOCK, keep=True)
        for given_, block in pieces(stream, sizes):
            recorder.step(given_, block)
        recorded = recorder.recorded()
        np.testing.assert_array_equal(recorded.read_words(0, len(stream.words)), stream.words)
        if sizes == [64]:
            shutil.rmtree(path / "words" / "c")  # no chunk is read again
            fit = min(room // stream.words[:2].nbytes, len(stream.words) // 2) * 2
            np.testing.assert_array_equal(recorded.read_words(0, fit), stream.words[:fit])


@settings(max_examples=5)
@given(
    before=st.lists(st.integers(1, 70), min_size=1, max_size=4),
    after=st.lists(st.integers(1, 70), min_size=1, max_size=4),
    stop=st.integers(1, 4),
    lost=st.integers(0, 2),
)
def test_a_run_is_gone_on_with_in_the_middle_of_a_word(
    tmp_path_factory, random_stream, before: list[int], after: list[int], stop: int, lost: int
) -> None:
    stream = random_stream(300, SHAPE)
    path = tmp_path_factory.mktemp("zarr") / "a.zarr"
    first = Recorder(path, SHAPE, stream.cycles, CLOCK)
    state, done = first.state(), 0
    for n, (given_, block) in enumerate(pieces(stream, before)):
        first.step(given_, block)
        if n < stop:  # the checkpoint; what comes after it is lost, though the store has it
            state = {name: array.copy() for name, array in first.state().items()}
            done = block.stop
        if n == stop + lost - 1:
            break
    second = Recorder(path, SHAPE, stream.cycles, CLOCK)
    second.restore(state)
    for given_, block in pieces(stream, after, done):
        second.step(given_, block)
    np.testing.assert_array_equal(words_of(path), stream.words)


@given(first=st.integers(0, 5), n=st.integers(0, 6))
@settings(max_examples=15)
def test_any_run_of_words_is_read(tmp_path_factory, random_stream, first: int, n: int) -> None:
    stream = random_stream(150, SHAPE)
    path = tmp_path_factory.mktemp("zarr") / "a.zarr"
    write_zarr(stream, path)
    words = ZarrStream(path).read_words(first, first + n)
    assert words.dtype == np.uint32
    np.testing.assert_array_equal(words, stream.words[first : first + n])


def test_the_state_is_the_count_and_the_open_word(tmp_path: Path, random_stream) -> None:
    stream = random_stream(300, SHAPE)
    recorder = Recorder(tmp_path / "a.zarr", SHAPE, stream.cycles, CLOCK)
    assert recorder.state() == {"cycles": 0, "spikes": 0}
    for given_, block in pieces(stream, [40, 24, 7]):
        recorder.step(given_, block)
        state = recorder.state()
        assert state["spikes"] == stream.planes()[: block.stop].sum()
        assert state.keys() - {"cycles", "spikes"} == ({"open_word"} if block.stop % 32 else set())
        if block.stop % 32:
            part = stream.planes()[block.stop // 32 * 32 : block.stop]
            np.testing.assert_array_equal(state["open_word"], pack_planes(part)[0])


def test_watched_pixels_have_their_words_also_after_a_restart(
    tmp_path: Path, random_stream
) -> None:
    stream, watch = random_stream(300, SHAPE), (np.array([[0], [1]]), np.array([[1, 2], [0, 1]]))
    for cut in ([300], [40, 24, 7, 229]):
        recorder = Recorder(tmp_path / "a.zarr", SHAPE, stream.cycles, CLOCK, watch=watch)
        for part, block in pieces(stream, cut):
            if block.start:
                state = recorder.state()
                recorder = Recorder(tmp_path / "a.zarr", SHAPE, stream.cycles, CLOCK, watch=watch)
                recorder.restore(state)
            recorder.step(part, block)
        np.testing.assert_array_equal(recorder.watched, stream.words[:, *watch])


def test_words_are_counted_as_they_are_written(tmp_path: Path, random_stream) -> None:
    stream = random_stream(128, SHAPE)
    assert record(stream, tmp_path / "a.zarr", [64]).bytes_written == stream.words.nbytes


@pytest.mark.parametrize("store", STORES)
def test_every_store_has_the_same_words_and_detects_damage(
    store: str, tmp_path: Path, random_stream
) -> None:
    stream = random_stream(200, SHAPE)
    with storing(store):
        record(stream, tmp_path / "a.zarr", [64])
    np.testing.assert_array_equal(words_of(tmp_path / "a.zarr"), stream.words)
    chunk = next(p for p in (tmp_path / "a.zarr" / "words" / "c").rglob("*") if p.is_file())
    data = bytearray(chunk.read_bytes())
    data[len(data) // 2] ^= 1
    chunk.write_bytes(bytes(data))
    with pytest.raises(InputError, match="not damaged in chunk"):
        words_of(tmp_path / "a.zarr")


def test_a_store_is_that_of_the_run(tmp_path: Path, random_stream) -> None:
    stream = random_stream(640, SHAPE)
    with storing("raw"):
        record(stream, tmp_path / "raw.zarr", [64])
    record(stream, tmp_path / "fast.zarr", [64])
    codecs = {
        name: (tmp_path / f"{name}.zarr" / "words" / "zarr.json").read_text(encoding="utf-8")
        for name in ("raw", "fast")
    }
    assert "zstd" not in codecs["raw"] and "crc32c" in codecs["raw"] and "zstd" in codecs["fast"]


def test_an_unfinished_store_is_refused_with_the_way_to_finish_it(
    tmp_path: Path, random_stream
) -> None:
    stream = random_stream(200, SHAPE)
    path = tmp_path / "out" / "stream.zarr"
    recorder = Recorder(path, SHAPE, stream.cycles, CLOCK)
    for given_, block in list(pieces(stream, [64]))[:-1]:
        recorder.step(given_, block)
        with pytest.raises(InputError) as refused:
            open_stream(path.parent)
        assert str(refused.value) == (
            f"{path} must be the stream.zarr of a finished run, not one that was interrupted; "
            f"finish it: viform run {path.parent} --resume --out {path.parent}"
        )
    recorder.step(*list(pieces(stream, [64]))[-1])
    assert open_stream(path.parent).cycles == 200


@pytest.mark.parametrize("end", [64, 70, 130])
def test_a_store_that_ends_before_its_time_is_sound_and_can_go_on(
    tmp_path: Path, random_stream, end: int
) -> None:
    whole = random_stream(200)

    def step(recorder: Recorder, start: int, stop: int) -> None:
        recorder.step(part_of(whole, slice(start, stop)), Block(start, stop - start))

    recorder = Recorder(tmp_path / "s.zarr", whole.shape, 200, whole.clock)
    step(recorder, 0, 64)
    state = recorder.state()
    if end > 64:
        step(recorder, 64, end)
    recorder.end(end)
    assert recorder.stop == end
    ended = ZarrStream(tmp_path / "s.zarr")
    assert ended.cycles == end
    assert part_of(ended) == part_of(whole, slice(0, end))
    later = Recorder(tmp_path / "s.zarr", whole.shape, 200, whole.clock)
    later.restore(state)
    step(later, 64, 128)
    with pytest.raises(InputError, match="one that was interrupted"):
        ZarrStream(tmp_path / "s.zarr")
    step(later, 128, 200)
    assert part_of(later.recorded()) == part_of(whole)


def test_a_store_of_unknown_length_ends_at_once(tmp_path: Path, random_stream) -> None:
    """A day at 40 kHz, of which 70 cycles come: chunks that never were are not looked for."""
    whole = random_stream(70)
    recorder = Recorder(tmp_path / "s.zarr", whole.shape, 40_000 * 86_400, whole.clock, keep=True)
    recorder.step(part_of(whole, slice(0, 64)), Block(0, 64))
    recorder.step(part_of(whole, slice(64, 70)), Block(64, 6))
    recorder.end(70)
    assert part_of(recorder.recorded()) == part_of(whole)


def test_resuming_without_the_store_is_refused(tmp_path: Path, random_stream) -> None:
    stream = random_stream(200, SHAPE)
    path = tmp_path / "stream.zarr"
    recorder = Recorder(path, SHAPE, stream.cycles, CLOCK)
    says = f"not missing or damaged; start afresh: remove {tmp_path}"
    with pytest.raises(InputError, match=says):
        recorder.step(*list(pieces(stream, [64]))[1])
    assert not path.exists()


def test_a_run_that_starts_afresh_replaces_the_store(tmp_path: Path, random_stream) -> None:
    record(random_stream(300, (4, 5), seed=3), tmp_path / "a.zarr", [64])
    stream = random_stream(100, SHAPE, seed=4)
    record(stream, tmp_path / "a.zarr", [64])
    np.testing.assert_array_equal(words_of(tmp_path / "a.zarr"), stream.words)


def test_a_lost_chunk_is_no_darkness(tmp_path: Path, random_stream) -> None:
    dark = Viform(random_stream(150, SHAPE).words * np.uint32(0), 150, CLOCK)
    for sizes in ([64], [40]):
        record(dark, tmp_path / "a.zarr", sizes)
        assert not words_of(tmp_path / "a.zarr").any()
    (tmp_path / "a.zarr/words/c/1/0/0").unlink()
    stream = ZarrStream(tmp_path / "a.zarr")
    assert not stream.read_words(0, 2).any()
    with pytest.raises(InputError, match="not one without chunk 1; copy it again, whole"):
        stream.read_words(0, 3)


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory, random_stream) -> Path:
    path = tmp_path_factory.mktemp("store") / "a.zarr"
    write_zarr(random_stream(150, SHAPE), path)
    return path


@pytest.mark.parametrize(
    ("attributes", "text"),
    [
        ({"viform": 2}, "not format 2; use a program that writes format 1"),
        ({"complete": False}, "not one that was interrupted; finish it"),
        ({"complete": 1}, "not one that was interrupted; finish it"),
        ({"cycles": 128}, r"not words of shape \(5, 2, 3\) for 128 cycles"),
        ({"cycles": 10**30}, r"not words of shape \(5, 2, 3\) for 10+ cycles"),
        ({"cycles": 0}, "not words of shape"),
        ({"cycles": -150}, "not words of shape"),
        ({"cycles": "many"}, "not something else"),
        ({"cycles": None}, "not something else"),
        ({"cycles": float("inf")}, "not something else"),
        ({"clock": [40_000, 0]}, "not something else"),
        ({"clock": [40_000]}, "not something else"),
        ({"clock": 40_000}, "not something else"),
        ({"start": []}, "not something else"),
    ],
)
def test_attributes_of_no_stream_are_refused(
    store: Path, tmp_path: Path, attributes: dict[str, object], text: str
) -> None:
    path = tmp_path / "a.zarr"
    shutil.copytree(store, path)
    document = json.loads((path / "zarr.json").read_text())
    document["attributes"] |= attributes
    (path / "zarr.json").write_text(json.dumps(document))
    with pytest.raises(InputError, match=text):
        open_stream(path)


@pytest.mark.parametrize(
    ("values", "text"),
    [
        ({"data_type": "int32"}, "not words of shape"),
        ({"shape": [5, 2]}, "not something else"),
        ({"shape": [5, 2, 10**15]}, "not chunks of shape"),
        ({"shape": [5, 0, 3]}, "not words of shape"),
        ({"node_type": "group"}, "not something else"),
        ({"zarr_format": 7}, "not something else"),
    ],
)
def test_words_of_another_kind_are_refused(
    store: Path, tmp_path: Path, values: dict[str, object], text: str
) -> None:
    path = tmp_path / "a.zarr"
    shutil.copytree(store, path)
    document = json.loads((path / "words/zarr.json").read_text())
    (path / "words/zarr.json").write_text(json.dumps(document | values))
    with pytest.raises(InputError, match=text):
        open_stream(path)


def test_spikes_beyond_the_last_cycle_are_refused(store: Path, tmp_path: Path) -> None:
    path = tmp_path / "a.zarr"
    shutil.copytree(store, path)
    words = zarr.open_group(path, mode="r+")["words"]
    words[4, 1, 2] = 1 << (150 - 128)
    stream = open_stream(path)
    stream.read_words(0, 4)
    with pytest.raises(InputError, match="not one with spikes beyond its last cycle"):
        stream.read_words(4, 5)


@pytest.mark.parametrize("missing", ["zarr.json", "words/zarr.json", "words"])
def test_a_store_with_a_part_missing_is_refused(store: Path, tmp_path: Path, missing: str) -> None:
    path = tmp_path / "a.zarr"
    shutil.copytree(store, path)
    gone = path / missing
    shutil.rmtree(gone) if gone.is_dir() else gone.unlink()
    with pytest.raises(InputError, match=f"{path} must be the stream.zarr of a finished run"):
        open_stream(path)


@pytest.mark.parametrize("content", [None, b"", b"\x00\xff" * 40])
def test_what_is_no_store_is_refused(tmp_path: Path, content: bytes | None) -> None:
    path = tmp_path / "a.zarr"
    path.mkdir() if content is None else path.write_bytes(content)
    with pytest.raises(InputError, match=f"{path} must be the stream.zarr of a finished run"):
        open_stream(path)


@pytest.mark.parametrize("part", ["zarr.json", "words/zarr.json", "words/c/0/0/0", "words/c/2/0/0"])
def test_damage_is_refused_or_gives_a_stream_that_keeps_its_promises(
    store: Path, tmp_path_factory, random_stream, damage, part: str
) -> None:
    whole = random_stream(150, SHAPE)
    path = tmp_path_factory.mktemp("damaged") / "a.zarr"
    shutil.copytree(store, path)
    content = (path / part).read_bytes()

    @settings(max_examples=50)
    @given(st.data())
    def holds(data: st.DataObject) -> None:
        (path / part).write_bytes(damage(data, content))
        try:
            stream = open_stream(path)
            words = stream.read_words(0, words_for(stream.cycles))
        except InputError:
            return
        again = Viform(words, stream.cycles, stream.clock)  # refuses spikes beyond the last cycle
        assert again.shape == stream.shape
        if "/c/" in part:  # chunks carry a checksum
            np.testing.assert_array_equal(words, whole.words)

    holds()
