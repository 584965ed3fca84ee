"""`.events.npz`: round trips, planes if they can hold the events, reading in parts."""

from __future__ import annotations

import zipfile
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cosim import Clock, Events, InputError, Viform
from cosim.files import event_file, notes_of, open_stream, write_events, write_stream
from cosim.files.event_file import read_events
from cosim.spikes.viform import words_for
from tests.cosim.spikes.whole_streams import events_of, viform_of

CLOCK = Clock(10**9)
NAME = "a.events.npz"


@pytest.fixture
def small_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    """Parts of seven events."""
    monkeypatch.setattr(event_file, "PART", 7)


def made(**changed: object) -> Events:
    """Events of an asynchronous chip: quantised, and more than one a pixel and tick."""
    values = {
        "row": np.array([0, 1, 0, 0], np.uint16),
        "column": np.array([1, 2, 1, 1], np.uint16),
        "time": np.array([-3, -3, 40, 40], np.int64),
        "width": np.array([4, 4, 41, 2], np.int64),
        "shape": (2, 3),
        "ticks": 50,
        "clock": CLOCK,
        "start": -5,
        "level": np.array([3, 1, 3, 3], np.uint16),
        "levels": 3,
    }
    return Events(**{**values, **changed})


def in_memory(stream) -> Viform:
    words = stream.read_words(0, words_for(stream.cycles))
    return Viform(words, stream.cycles, stream.clock, stream.start)


@pytest.mark.usefixtures("small_parts")
@pytest.mark.parametrize("cycles", [1, 32, 75])
def test_a_stream_s_events_are_those_of_the_event_form(
    tmp_path: Path, random_stream, cycles: int
) -> None:
    stream = random_stream(cycles, (5, 7), clock=Clock(2997, 100), start=192)
    path = tmp_path / NAME
    assert write_stream(stream, path) == []
    assert read_events(path) == events_of(stream)
    again = open_stream(path)
    assert in_memory(again) == stream == viform_of(read_events(path))
    assert notes_of(again) == ()


def test_a_stream_without_spikes_stays_one(tmp_path: Path) -> None:
    dark = Viform(np.zeros((3, 2, 3), np.uint32), 70, CLOCK, 9)
    write_stream(dark, tmp_path / NAME)
    assert len(read_events(tmp_path / NAME)) == 0
    assert in_memory(open_stream(tmp_path / NAME)) == dark


def test_it_is_an_ordinary_numpy_archive(tmp_path: Path) -> None:
    write_events(made(), tmp_path / NAME)
    with np.load(tmp_path / NAME) as file:
        assert sorted(file) == [
            "clock", "column", "level", "levels", "row", "shape", "start", "ticks", "time", "width",
        ]  # fmt: skip
        np.testing.assert_array_equal(file["time"], [-3, -3, 40, 40])
        assert file["shape"].tolist() + file["clock"].tolist() == [2, 3, 10**9, 1]


@pytest.mark.parametrize("changed", [{}, {"level": None}, {"level": None, "levels": 1}])
def test_events_stay_events(tmp_path: Path, changed: dict[str, object]) -> None:
    events = made(**changed)
    write_events(events, tmp_path / NAME)
    assert read_events(tmp_path / NAME) == events
    opened = open_stream(tmp_path / NAME)
    assert (opened.shape, opened.cycles, opened.clock) == ((2, 3), 50, CLOCK)
    assert write_stream(opened, tmp_path / "b.events.npz") == []
    assert read_events(tmp_path / "b.events.npz") == events


@pytest.mark.parametrize("ending", [".dat", ".npz", ".zarr"])
@pytest.mark.parametrize("changed", [{}, {"level": None}, {"time": np.arange(4)}])
def test_events_that_planes_cannot_hold_are_refused(
    tmp_path: Path, ending: str, changed: dict[str, object]
) -> None:
    wide = {"shape": (2, 4)}  # a .dat frame of whole bytes
    write_events(made(**wide, **changed), tmp_path / NAME)
    with pytest.raises(InputError) as refused:
        write_stream(open_stream(tmp_path / NAME), tmp_path / f"a{ending}")
    assert str(refused.value) == (
        f"{tmp_path / NAME} must be full spikes alone, at most one a pixel and tick, to be held in "
        f"planes, not others; keep it as events: viform convert {tmp_path / NAME} OUT.events.npz"
    )
    assert [p.name for p in tmp_path.iterdir()] == [NAME]


@pytest.mark.usefixtures("small_parts")
@settings(max_examples=30)
@given(seed=st.integers(0, 2**32 - 1), count=st.integers(1, 60), apart=st.sampled_from([1, 997]))
def test_widths_that_planes_do_not_keep_are_counted(
    tmp_path_factory, seed: int, count: int, apart: int
) -> None:
    """apart: ticks between two times at which pixels may fire; most words are 0 where it is large,
    and the others alone are kept."""
    rng = np.random.default_rng(seed)
    cell = rng.choice(6 * 50, min(count, 300), replace=False)  # one a pixel and tick
    time, pixel = np.divmod(np.sort(cell), 6)
    order = np.lexsort((rng.random(len(time)), time))  # those of one tick in any order
    time, pixel = time[order] * apart - 5, pixel[order]
    width = np.empty(len(time), np.int64)
    last = dict.fromkeys(range(6), -6)
    for n, (t, p) in enumerate(zip(time.tolist(), pixel.tolist(), strict=True)):
        width[n], last[p] = t - last[p], t
    other = rng.random(len(time)) < 0.3
    width[other] += 1
    row, column = (x.astype(np.uint16) for x in np.divmod(pixel, 3))
    events = Events(row, column, time, width, (2, 3), 50 * apart, CLOCK, -5)
    path = tmp_path_factory.mktemp("events") / NAME
    write_events(events, path)
    stream = open_stream(path)
    assert in_memory(stream) == viform_of(events)
    said = f"{other.sum()} of {len(time)} events of {path} have a width that is not the interval "
    assert notes_of(stream) == ((said + "between spikes, which is all that planes keep",)
                                if other.any() else ())  # fmt: skip


class Long:
    """A stream of 100 words of 16 pixels, computed on demand; counts the words that are read."""

    shape, cycles, clock, most = (4, 4), 3200, Clock(40_000), 0

    def read_words(self, first: int, stop: int) -> np.ndarray:
        self.most = max(self.most, stop - first)
        rng = np.random.default_rng(first)
        return rng.integers(0, 2**32, (stop - first, 4, 4), np.uint32)


def test_a_stream_is_written_a_word_at_a_time(tmp_path: Path) -> None:
    stream = Long()
    write_stream(stream, tmp_path / NAME)
    assert stream.most == 1
    again = open_stream(tmp_path / NAME)
    for w in range(100):
        np.testing.assert_array_equal(again.read_words(w, w + 1), stream.read_words(w, w + 1))


def test_what_memory_cannot_hold_is_refused_before_it_is_made(
    tmp_path: Path, random_stream, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / NAME
    write_stream(random_stream(75, (40, 40)), path)
    free = SimpleNamespace(available=2**14)
    monkeypatch.setattr("cosim.compute.memory.psutil.virtual_memory", lambda: free)
    must = "must be small enough for the 1.53e-05 GiB of memory that is free, not "
    with pytest.raises(InputError) as refused:
        open_stream(path).read_words(0, 1)
    assert str(refused.value) == (
        f"the planes of {path} {must}1.79e-05 GiB; keep its events, or cut them into shorter files"
    )
    with pytest.raises(InputError, match=r"^the \d+ events of .* must be small enough for"):
        read_events(path)
    assert (
        write_stream(open_stream(path), tmp_path / "b.events.npz") == []
    )  # needs no more than a part


def test_planes_of_a_fast_clock_are_refused_where_they_are_vast(tmp_path: Path) -> None:
    write_events(made(ticks=10**15), tmp_path / NAME)
    with pytest.raises(InputError, match=r"must be small enough for .* GiB; keep its events"):
        open_stream(tmp_path / NAME).read_words(0, 1)


def test_a_frame_too_wide_for_places_is_refused(tmp_path: Path) -> None:
    wide = Viform(np.zeros((1, 1, 2**16 + 1), np.uint32), 1, CLOCK)
    with pytest.raises(InputError) as refused:
        write_stream(wide, tmp_path / NAME)
    assert str(refused.value) == (
        "the size of an event stream must be at most 65536x65536, not 65537x1; use .npz or .zarr"
    )
    assert not list(tmp_path.iterdir())


GOOD = {
    "row": np.array([0, 1], np.uint16),
    "column": np.array([1, 2], np.uint16),
    "time": np.array([3, 40]),
    "width": np.array([4, 4]),
    "shape": np.array([2, 3]),
    "ticks": np.array(50),
    "clock": np.array([40_000, 1]),
    "start": np.array(0),
}


def without(name: str) -> dict[str, np.ndarray]:
    return {key: value for key, value in GOOD.items() if key != name}


@pytest.mark.parametrize(
    ("arrays", "given"),
    [
        ({}, "one where it holds no arrays"),
        *((without(name), f"one without '{name}'") for name in GOOD),
        (GOOD | {"tag": np.array(1)}, "one where 'tag' is no array of this format"),
        (GOOD | {"row": GOOD["row"].astype(np.int64)}, "one where row is (2,) int64, not (2,)"),
        (GOOD | {"row": np.zeros(3, np.uint16)}, "one where row is (3,) uint16, not (2,) uint16"),
        (GOOD | {"time": np.zeros((2, 1), np.int64)}, "one where row is (2,) uint16, not (-1,)"),
        (GOOD | {"time": np.array([40, 3])}, "one where times must rise from 0 to 49"),
        (GOOD | {"time": np.array([3, 50])}, "one where times must rise from 0 to 49"),
        (GOOD | {"width": np.array([4, 0])}, "one where widths must be 1 tick or more"),
        (GOOD | {"column": np.array([1, 3], np.uint16)}, "one where events must lie within 2 rows"),
        (GOOD | {"shape": np.array([2])}, "one where shape is of shape (1,)"),
        (GOOD | {"shape": np.array([0, 3])}, "one where shape is 0 rows, 3 columns"),
        (GOOD | {"shape": np.array([2, 2**17])}, "one where shape is 2 rows, 131072 columns"),
        (GOOD | {"ticks": np.array(0)}, "one where ticks and levels must be 1 or more"),
        (GOOD | {"ticks": np.array(2.5)}, "one where 'numpy.float64' object cannot"),
        (GOOD | {"ticks": np.array(2**63 - 1)}, "one where ticks and start are 92233720368547758"),
        (GOOD | {"start": np.array(-(2**63))}, "one where ticks and start are 50, -9223372036854"),
        (GOOD | {"clock": np.array([40_000, 0])}, "one where clock frequency must be positive"),
        (GOOD | {"levels": np.array(0)}, "one where ticks and levels must be 1 or more"),
        (GOOD | {"level": np.array([1, 2], np.uint16)}, "one where levels must be 1 or less"),
    ],
)  # fmt: skip
def test_archives_that_hold_no_events_are_refused(tmp_path: Path, arrays, given: str) -> None:
    path = tmp_path / NAME
    np.savez(path, **arrays)
    with pytest.raises(InputError) as refused:
        open_stream(path).read_words(0, 1)
    text = str(refused.value)
    assert text.startswith(f"{path} must be events: row, column, time, width, shape, ticks, clock")
    assert f", not {given}" in text
    assert text.endswith("; write it with viform convert")


@pytest.mark.usefixtures("small_parts")
def test_time_must_rise_from_part_to_part(tmp_path: Path) -> None:
    time = np.array([*range(10, 17), 9, 20])
    np.savez(tmp_path / NAME, **GOOD | {
        "time": time, "width": np.ones(9, np.int64), "row": np.zeros(9, np.uint16),
        "column": np.zeros(9, np.uint16),
    })  # fmt: skip
    with pytest.raises(InputError, match="one where times must rise;"):
        read_events(tmp_path / NAME)


def test_a_header_that_promises_too_much_is_refused(tmp_path: Path) -> None:
    path = tmp_path / NAME
    np.savez(path, **GOOD)
    with zipfile.ZipFile(path) as file:
        members = {name: file.read(name) for name in file.namelist()}
    with zipfile.ZipFile(path, "w") as file:
        for name, data in members.items():
            if name not in ("shape.npy", "clock.npy"):
                data = data.replace(b"(2,), }      ", b"(1000000,), }")
            file.writestr(name, data)
    with pytest.raises(InputError, match=r"one where row.npy is shorter than its array;"):
        read_events(path)


@given(st.binary(max_size=300), st.booleans())
def test_random_bytes_are_refused(tmp_path_factory, content: bytes, magic: bool) -> None:
    path = tmp_path_factory.mktemp("events") / NAME
    path.write_bytes(b"PK\x03\x04" + content + b"PK\x05\x06" if magic else content)
    with pytest.raises(InputError, match="must be events"):
        open_stream(path)


@settings(max_examples=80)
@given(st.data(), st.booleans())
def test_damage_is_refused_or_harmless(
    tmp_path_factory, damage, random_stream, data: st.DataObject, quantised: bool
) -> None:
    path = tmp_path_factory.mktemp("events") / NAME
    events = made() if quantised else events_of(random_stream(40))
    write_events(events, path)
    path.write_bytes(damage(data, path.read_bytes()))
    try:
        again = read_events(path)
    except InputError as exc:
        assert len(str(exc).splitlines()) == 1
        return
    assert again == events
