"""Frames that are needed again are decoded and fitted once, within a stated bound of memory."""

from __future__ import annotations

import os
from collections.abc import Iterator
from threading import Thread
from typing import Any

import numpy as np
import pytest

from cosim import Block, Clock, InputError
from scenarios.scenes.clips import file_cache
from scenarios.scenes.clips.clip import Clip
from scenarios.scenes.clips.decoder import Decoder
from scenarios.scenes.clips.film import FilmSource

CLOCK = Clock(40_000)
SHAPE = (8, 16)
PLANE = 4 * SHAPE[0] * SHAPE[1]
NOISE = np.random.default_rng(3).integers(0, 256, (12, *SHAPE), np.uint8)


@pytest.fixture(autouse=True)
def _empty() -> Iterator[None]:
    file_cache._CACHE.clear()
    yield
    file_cache._CACHE.clear()


@pytest.fixture
def work(monkeypatch) -> list[str]:
    """What is done for each frame."""
    done: list[str] = []
    decode, linear = Decoder._decode, Clip._linear
    monkeypatch.setattr(Decoder, "_decode", lambda each: done.append("decode") or decode(each))
    monkeypatch.setattr(Clip, "_linear", lambda *given: done.append("fit") or linear(*given))
    return done


def test_the_passes_of_a_run_over_a_clip_decode_and_fit_each_frame_once(tmp_path, make_clip, work):
    path = make_clip(tmp_path / "a.mkv", NOISE, rate=1000)
    passes = []
    for _ in range(3):  # survey, record, images
        source = FilmSource(path, SHAPE, 500.0, CLOCK, 400)
        passes.append([source.step(None, Block(start, 40)) for start in range(0, 400, 40)])
        source.truth(CLOCK.edge(20))
    assert (work.count("decode"), work.count("fit")) == (11, 11)
    for first, other in zip(passes[0], passes[2], strict=True):
        edge = first.pieces[0].start
        np.testing.assert_array_equal(first.at(edge), other.at(edge))


def test_kept_frames_keep_no_threads(tmp_path, make_clip):
    """In a forked process they would be freed without them, and FFmpeg would wait for ever."""
    colours = np.random.default_rng(3).integers(0, 256, (12, *SHAPE, 3), np.uint8)
    clip = Clip(make_clip(tmp_path / "a.mkv", colours), SHAPE)
    threads = []
    for n in range(2, 12):
        assert clip.frame(n) is not None
        threads.append(len(os.listdir("/proc/self/task")))
    assert file_cache._CACHE.bytes > 12 * PLANE and threads[-1] <= threads[0]


def test_another_grid_takes_the_decoded_frames(tmp_path, make_clip, work):
    path = make_clip(tmp_path / "a.mkv", NOISE)
    for shape in ((8, 16), (4, 8), (8, 16)):
        clip = Clip(path, shape)
        assert all(clip.frame(n) is not None for n in range(12)) and clip.frame(12) is None
        assert (clip.count, clip.ended) == (12, True)
    assert work.count("fit") == 24
    small = Clip(path, (4, 8)).frame(5)
    file_cache._CACHE.clear()
    np.testing.assert_array_equal(Clip(path, (4, 8)).frame(5), small)


def test_a_clip_from_the_cache_has_the_notes_of_one_that_is_decoded(tmp_path, make_clip):
    path = make_clip(tmp_path / "a.mkv", np.repeat(NOISE, 2, axis=1))
    path.write_bytes(path.read_bytes()[:-900])
    told = []
    for _ in range(2):
        clip = Clip(path, SHAPE)
        notes = [list(clip.notes)]
        for n in range(13):
            clip.frame(n)
            notes.append(list(clip.notes))
        told.append(notes)
    assert told[0] == told[1]
    assert len(told[0][-1]) > 0


def test_the_cache_is_bounded_and_the_file_used_last_stays(tmp_path, make_clip, monkeypatch, work):
    paths = [make_clip(tmp_path / f"{name}.mkv", NOISE) for name in "abc"]
    right = [[Clip(path, SHAPE).frame(n) for n in range(12)] for path in paths]
    file_cache._CACHE.clear()
    monkeypatch.setattr(file_cache, "KEPT_BYTES", 6 * PLANE)
    for _ in range(2):
        for path, planes in zip(paths, right, strict=True):
            clip = Clip(path, SHAPE)
            for n, plane in enumerate(planes):
                np.testing.assert_array_equal(clip.frame(n), plane)
                assert file_cache._CACHE.bytes <= 6 * PLANE
    work.clear()
    clip = Clip(paths[2], SHAPE)
    assert clip.frame(2) is not None and not work  # of a larger file, the first frames stay


def test_a_file_that_was_replaced_is_read_anew(tmp_path, make_clip):
    path = make_clip(tmp_path / "a.mkv", NOISE)
    before = Clip(path, SHAPE).frame(1)
    path.unlink()
    make_clip(path, NOISE[::-1])
    assert not np.array_equal(Clip(path, SHAPE).frame(1), before)


def test_threads_that_film_one_clip_have_the_same_frames(tmp_path, make_clip, work):
    path = make_clip(tmp_path / "a.mkv", NOISE)
    found: list[list[Any]] = []

    def film() -> None:
        clip = Clip(path, SHAPE)
        found.append([clip.frame(n) for n in range(12)])

    threads = [Thread(target=film) for _ in range(4)]
    for each in threads:
        each.start()
    for each in threads:
        each.join()
    assert len(found) == 4 and work.count("fit") == 12
    for planes in found:
        np.testing.assert_array_equal(planes, found[0])


def test_frames_of_two_files_are_never_mixed(tmp_path, make_clip):
    """A clip of which frames are kept is opened when one is missing, and may be another by then."""
    path = make_clip(tmp_path / "a.mkv", NOISE)
    before = [Clip(path, SHAPE).frame(n) for n in range(12)]
    clip = Clip(path, SHAPE)  # opens nothing
    np.testing.assert_array_equal(clip.frame(3), before[3])
    os.replace(make_clip(tmp_path / "b.mkv", NOISE[::-1]), path)
    file_cache._CACHE.clear()
    with pytest.raises(InputError, match="changed since its first frames were read"):
        clip.frame(5)


def test_kept_frames_cannot_be_changed(tmp_path, make_clip):
    clip = Clip(make_clip(tmp_path / "a.mkv", NOISE), SHAPE)
    with pytest.raises(ValueError, match="read-only"):
        clip.frame(0)[:] = 0
